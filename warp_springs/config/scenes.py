"""The world of a configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, field_serializer, field_validator, model_validator

from warp_springs import scene, surfaces
from warp_springs.config.section import BesideFile, Section, Triple, one_of
from warp_springs.materials import FRICTION

__all__ = ["GroundConfig", "SceneConfig"]


class Surface(Section):
    """An elastic surface with friction."""

    stiffness: float = Field(1e5, gt=0.0)
    """[N/m]"""
    material: tuple[str, str] | None = Field(None, exclude=True)
    """Two surfaces of ws.materials.FRICTION such as ["ice", "ice"], instead of coefficients."""
    static_friction: float = Field(1.0, ge=0.0)
    """Coefficient below which a mass sticks; the default is rubber on concrete."""
    kinetic_friction: float = Field(0.8, ge=0.0)
    """Coefficient with which a mass slides."""

    @model_validator(mode="before")
    @classmethod
    def _coefficients_of_materials(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or data.get("material") is None:
            return data
        data = dict(data)
        surfaces = data.pop("material")
        if "static_friction" in data or "kinetic_friction" in data:
            raise ValueError("give either a material or the coefficients of friction")
        try:
            pair = FRICTION[tuple(surfaces) if isinstance(surfaces, list) else surfaces]
        except KeyError as error:
            raise ValueError(error.args[0]) from None
        return data | {"static_friction": pair.static, "kinetic_friction": pair.kinetic}


class GroundConfig(Surface):
    """The plane z = 0."""

    friction: Literal["coulomb", "course"] = "coulomb"
    """The law: impulses against velocity, or the classroom's force against normal force."""

    def build(self) -> scene.Ground:
        """Make the ground."""
        return scene.Ground(**self.model_dump())


class Obstacle(Surface):
    """An obstacle; its keys are those of the class it is called after."""

    def build(self) -> Any:
        """Make the obstacle."""
        settings = self.model_dump(exclude={"type"})
        return getattr(surfaces, type(self).__name__.removesuffix("Config"))(**settings)


class PlaneConfig(Obstacle):
    """The half-space behind a plane."""

    type: Literal["plane"]
    normal: Triple = (0.0, 0.0, 1.0)
    """Outward, of any length."""
    offset: float = 0.0
    """Of normal . p = offset [m]."""


class SphereConfig(Obstacle):
    """A ball."""

    type: Literal["sphere"]
    center: Triple
    """[m]"""
    radius: float = Field(gt=0.0)
    """[m]"""


class BoxConfig(Obstacle):
    """A box, turned about its centre."""

    type: Literal["box"]
    center: Triple
    """[m]"""
    size: Triple
    """[m]"""
    axis: Triple = (0.0, 0.0, 1.0)
    """Of the turn."""
    angle: float = 0.0
    """[rad]"""


class HeightFieldConfig(Obstacle):
    """Terrain, from a table of heights or from the brightness of a picture."""

    type: Literal["height_field"]
    spacing: float = Field(gt=0.0)
    """Distance of neighbouring grid points [m]."""
    heights: tuple[tuple[float, ...], ...] | None = None
    """[m]; rows run along x."""
    picture: BesideFile | None = None
    """A file, relative to that of the configuration."""
    lowest: float = 0.0
    """Height of black [m]."""
    highest: float = 0.1
    """Height of white [m]."""
    origin: Triple = (0.0, 0.0, 0.0)
    """Where the first grid point is, and what is added to all heights [m]."""

    @model_validator(mode="after")
    def _one_source(self) -> HeightFieldConfig:
        if (self.heights is None) == (self.picture is None):
            raise ValueError("give either heights or a picture")
        return self

    def build(self) -> surfaces.HeightField:
        """Make the terrain."""
        heights = self.heights
        if heights is None:
            heights = surfaces.height_map(self.picture, self.lowest, self.highest)
        settings = self.model_dump(exclude={"type", "heights", "picture", "lowest", "highest"})
        return surfaces.HeightField(heights=heights, **settings)


class RoughConfig(Obstacle):
    """Hills that a seed decides; their highest point is at z = 0."""

    type: Literal["rough"]
    seed: int = Field(1, ge=0)
    """Of the hills."""
    height: float = Field(0.05, gt=0.0)
    """From the lowest point to the highest [m]."""
    feature: float = Field(0.3, gt=0.0)
    """Shortest wavelength [m]."""
    size: float = Field(8.0, gt=0.0)
    """Edge of the square about the origin that they cover [m]."""
    spacing: float = Field(0.1, gt=0.0)
    """Distance of grid points [m]."""

    def build(self) -> surfaces.HeightField:
        """Make the terrain."""
        return surfaces.rough_terrain(**self.model_dump(exclude={"type"}))


class WaterConfig(Section):
    """Water below a level."""

    level: float = 0.0
    """[m]"""
    density: float = Field(1.0, ge=0.0)
    """As a multiple of that of the robots."""
    drag: float = Field(0.0, ge=0.0)
    """[kg/m]"""
    layer: float = Field(0.02, gt=0.0)
    """Way over which a mass becomes immersed [m]."""


class CollisionsConfig(Section):
    """Bodies that do not pass through each other."""

    thickness: float = Field(0.0, ge=0.0)
    """Distance that surfaces keep [m]; 0: 4 % of the median spring."""
    stiffness: float = Field(1e5, gt=0.0)
    """[N/m]"""
    static_friction: float = Field(1.0, ge=0.0)
    """Coefficient below which two surfaces do not slide."""
    kinetic_friction: float = Field(0.8, ge=0.0)
    """Coefficient with which they slide."""
    damping: float = Field(0.1, ge=0.0)
    """As a part of critical damping."""
    within: bool = True
    """Whether a body also collides with itself."""


class SceneConfig(Section):
    """Where the robots live."""

    gravity: Triple = (0.0, 0.0, -9.81)
    """[m/s^2]"""
    damping: float = Field(0.0, ge=0.0)
    """Rate at which velocities decay [1/s]."""
    drag: float = Field(0.0, ge=0.0)
    """Quadratic drag of a mass [kg/m]."""
    ground: GroundConfig | None = GroundConfig()
    """The plane z = 0; false for none."""
    wind: Triple | None = None
    """Velocity of the air [m/s]; needs drag."""
    water: WaterConfig | None = None
    obstacles: tuple[
        one_of((PlaneConfig, SphereConfig, BoxConfig, HeightFieldConfig, RoughConfig), "type"), ...
    ] = ()
    collisions: CollisionsConfig | None = None

    @field_validator("ground", mode="before")
    @classmethod
    def _ground_may_be_false(cls, value: Any) -> Any:
        return {True: {}, False: None}[value] if isinstance(value, bool) else value

    @field_serializer("ground")
    def _no_ground_is_false(self, value: GroundConfig | None) -> Any:
        return False if value is None else value.model_dump()

    def build(self) -> scene.Scene:
        """Make the scene."""
        return scene.Scene(
            gravity=self.gravity,
            damping=self.damping,
            drag=self.drag,
            ground=self.ground and self.ground.build(),
            wind=self.wind,
            water=self.water and scene.Water(**self.water.model_dump()),
            obstacles=tuple(obstacle.build() for obstacle in self.obstacles),
            collisions=self.collisions and scene.Collisions(**self.collisions.model_dump()),
        )
