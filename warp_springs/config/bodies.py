"""Bodies of a configuration: one of the shapes, a mesh file, or a saved robot."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, field_validator

from warp_springs import shapes
from warp_springs.config.section import BesideFile, Section, Triple, one_of
from warp_springs.robot import Robot

__all__ = ["SHAPES", "AnyBody", "AnyShape", "BodyConfig", "MeshConfig", "SavedConfig"]


class BodyConfig(Section):
    """A body made by one of the shapes, standing on the ground."""

    stiffness: float = Field(1000.0, gt=0.0)
    """Stiffness of the springs [N/m], unless a material or an encoding decides it."""

    def build(self) -> Robot:
        """Make the body."""
        settings = self.model_dump(exclude_none=True)
        return getattr(shapes, settings.pop("shape"))(**settings)


class Cube(BodyConfig):
    """Eight masses, 28 springs between all pairs."""

    shape: Literal["cube"]
    edge: float = Field(0.1, gt=0.0)
    """Length of an edge [m]."""
    mass: float = Field(0.8, gt=0.0)
    """Of the whole body [kg]."""


class Tetrahedron(BodyConfig):
    """Four masses, six springs."""

    shape: Literal["tetrahedron"]
    edge: float = Field(0.1, gt=0.0)
    """Length of an edge [m]."""
    mass: float = Field(0.4, gt=0.0)
    """Of the whole body [kg]."""


class Octahedron(BodyConfig):
    """Six masses, 15 springs."""

    shape: Literal["octahedron"]
    edge: float = Field(0.1, gt=0.0)
    """Length of an edge [m]."""
    mass: float = Field(0.6, gt=0.0)
    """Of the whole body [kg]."""


class Lattice(BodyConfig):
    """A block of nx x ny x nz voxels."""

    shape: Literal["lattice"]
    nx: int = Field(ge=1)
    """Voxels along x."""
    ny: int = Field(ge=1)
    """Voxels along y."""
    nz: int = Field(ge=1)
    """Voxels along z."""
    edge: float = Field(0.1, gt=0.0)
    """Length of a voxel's edge [m]."""
    mass_per_vertex: float = Field(0.1, gt=0.0)
    """[kg]"""


class Voxels(BodyConfig):
    """Voxels drawn as layers, the lowest first, each a map seen from above.

    A layer is a list of rows, the farthest (largest y) first; a row runs along x and is either a
    string in which '#' is a voxel and '.' is none, or a list of 1 and 0.
    """

    shape: Literal["voxels"]
    layers: tuple[tuple[str | tuple[int, ...], ...], ...]
    """For example [["#.#"], ["###"]]."""
    edge: float = Field(0.1, gt=0.0)
    """Length of a voxel's edge [m]."""
    mass_per_vertex: float = Field(0.1, gt=0.0)
    """[kg]"""

    @field_validator("layers")
    @classmethod
    def _rectangular(cls, layers: tuple) -> tuple:
        voxels = 0
        for z, layer in enumerate(layers):
            for y, row in enumerate(layer):
                where = f"layer {z}, row {y}"
                if wrong := set(row) - ({"#", "."} if isinstance(row, str) else {0, 1}):
                    raise ValueError(f"{where}: {wrong.pop()!r} is neither a voxel nor none")
                if len(layer) != len(layers[0]) or len(row) != len(layers[0][0]):
                    raise ValueError(f"{where}: every layer and row must be as large as the first")
                voxels += sum(cell in ("#", 1) for cell in row)
        if not voxels:
            raise ValueError("there is no voxel")
        return layers

    @property
    def mask(self) -> np.ndarray:
        """Which voxels exist, shape (nx, ny, nz), bool."""
        cells = [[[c in ("#", 1) for c in row] for row in layer[::-1]] for layer in self.layers]
        return np.array(cells, dtype=bool).transpose(2, 1, 0)

    def build(self) -> Robot:
        """Make the body."""
        settings = self.model_dump(exclude={"shape", "layers"})
        return shapes.voxels(self.mask, **settings)


class Beam(BodyConfig):
    """A braced beam along x, whose cells need not be cubes."""

    shape: Literal["beam"]
    length: float = Field(1.0, gt=0.0)
    """Along x [m]."""
    width: float = Field(0.1, gt=0.0)
    """Along y [m]."""
    height: float = Field(0.1, gt=0.0)
    """Along z [m]."""
    cells: tuple[int, int, int] = (10, 1, 1)
    """Along x, y and z."""
    mass: float = Field(1.0, gt=0.0)
    """Of the whole body [kg]."""


class Chain(BodyConfig):
    """Masses in a row along x, each joined to the next."""

    shape: Literal["chain"]
    links: int = Field(10, ge=1)
    """Number of springs."""
    length: float = Field(1.0, gt=0.0)
    """Of the whole chain [m]."""
    mass: float = Field(1.0, gt=0.0)
    """Of the whole chain [kg]."""


class Snake(BodyConfig):
    """A row of cubes along x that cables pull together along its four long edges."""

    shape: Literal["snake"]
    segments: int = Field(8, ge=1)
    """Number of cubes."""
    edge: float = Field(0.1, gt=0.0)
    """Of a cube [m]."""
    span: int = Field(2, ge=1)
    """Cubes between the ends of a cable."""
    mass: float = Field(2.0, gt=0.0)
    """Of the whole body [kg]."""
    cable: float = Field(2000.0, gt=0.0)
    """Stiffness of the cables [N/m]."""


class Sphere(BodyConfig):
    """A solid ball."""

    shape: Literal["sphere"]
    radius: float = Field(0.1, gt=0.0)
    """[m]"""
    subdivisions: int = Field(2, ge=0, le=6)
    """How often the triangles of an icosahedron are quartered."""
    mass: float = Field(1.0, gt=0.0)
    """Of the whole body [kg]."""


class RandomLattice(BodyConfig):
    """A box filled with random masses, each joined to its neighbours."""

    shape: Literal["random_lattice"]
    bounds: Triple
    """Size of the box [m]."""
    spacing: float = Field(gt=0.0)
    """Least distance of two masses [m]."""
    seed: int = Field(0, ge=0)
    """From which the places follow."""
    reach: float = Field(2.3, ge=1.0)
    """Longest spring [spacings]."""
    n_springs: int | None = Field(None, ge=1)
    """Exactly how many springs, the shortest ones."""
    mass: float = Field(1.0, gt=0.0)
    """Of the whole body [kg]."""


class MeshConfig(BodyConfig):
    """A mesh file of any format that `read_mesh` reads, on request filled."""

    shape: Literal["mesh"]
    path: BesideFile
    """The file, relative to that of the configuration."""
    scale: float | str = 1.0
    """Metres in a unit of the file, or "mm", "cm", "in", ..."""
    diagonals: bool = True
    """Whether all corners of a cell are joined instead of its edges alone."""
    fill: float | None = Field(None, gt=0.0)
    """Distance [m] of masses that fill a closed surface."""
    seed: int | None = Field(None, ge=0)
    """From which the places of these masses follow; a cubic lattice when left out."""
    mass: float = Field(1.0, gt=0.0)
    """Of the whole body [kg]."""
    density: float | None = Field(None, gt=0.0)
    """Of solid cells [kg/m^3], instead of the mass."""

    def build(self) -> Robot:
        """Read the file, and fill what it holds."""
        from warp_springs.io.mesh.read import read_mesh

        common = {"mass": self.mass, "stiffness": self.stiffness}
        body = read_mesh(
            self.path,
            scale=self.scale,
            diagonals=self.diagonals,
            density=self.density,
            **common,
        )
        if self.fill is None:
            return body
        return shapes.filled(body, self.fill, seed=self.seed, **common)


class SavedConfig(Section):
    """A robot that `Robot.save` wrote, as it is."""

    shape: Literal["saved"]
    path: BesideFile
    """The file, relative to that of the configuration."""

    def build(self) -> Robot:
        """Read the file."""
        return Robot.load(self.path)


SHAPES = (Cube, Tetrahedron, Octahedron, Lattice, Voxels, Beam, Chain, Snake, Sphere, RandomLattice)
"""The bodies that need no file."""
AnyShape = one_of(SHAPES, "shape")
AnyBody = one_of((*SHAPES, MeshConfig, SavedConfig), "shape")
