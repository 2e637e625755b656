"""Scene files: everything that a simulation needs in one TOML file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, PrivateAttr, model_validator

from warp_springs.config.robots import RobotConfig
from warp_springs.config.scenes import SceneConfig
from warp_springs.config.section import Section
from warp_springs.config.simulation import SimulationConfig
from warp_springs.config.text import ConfigError, parse, read_text
from warp_springs.result import Result
from warp_springs.robot import Robot
from warp_springs.simulation import Simulation

__all__ = ["MOST_SHOWN", "OUTPUTS", "RecordConfig", "SceneFile", "load_scene"]

OUTPUTS = ("result", "usd", "picture", "energies", "page", "mesh")
"""What a run may write."""
MOST_SHOWN = 64
"""Robots in one picture."""


class Timing(SimulationConfig):
    """How long, and how motion is computed."""

    duration: float = Field(gt=0.0)
    """[s]"""
    world: Literal["apart", "grid", "together"] = "apart"
    """Each robot in a world of its own, side by side there, or all in one, where they collide if
    there is a table [scene.collisions]."""


class RecordConfig(Section):
    """What is kept of the motion, and which files are written."""

    fps: float = Field(60.0, gt=0.0)
    """Frames in a second of the simulation."""
    energy: bool = True
    """Whether energies are recorded with the frames."""
    robots: tuple[int, ...] | None = None
    """Whose frames; of all when left out."""
    color: Literal["stress", "material"] = "stress"
    """What the colour of a bar says."""
    grid: bool = True
    """Whether several robots are shown side by side; otherwise where they are."""
    write: tuple[Literal[OUTPUTS], ...] = ("result", "usd", "picture", "energies")  # type: ignore[valid-type]
    """result (.npz), usd (.usdc), picture (.png), energies (.png), page (.html), mesh (.pvd)."""

    @model_validator(mode="after")
    def _energies_are_recorded(self) -> RecordConfig:
        if "energies" in self.write and not self.energy and "write" in self.model_fields_set:
            raise ValueError("write: energies are to be plotted, but energy = false")
        return self


class SceneFile(Section):
    """A scene with its robots, how it is simulated, and what is recorded."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")
    """What the files that are written are called."""
    about: str = ""
    """What it shows, in one line."""
    robot: RobotConfig | None = None
    robots: tuple[RobotConfig, ...] = ()
    """Instead of one robot, several."""
    scene: SceneConfig = SceneConfig()
    simulation: Timing
    record: RecordConfig = RecordConfig()

    _source: str = PrivateAttr("")
    """The file with a colon, for errors."""

    @model_validator(mode="after")
    def _there_are_robots(self) -> SceneFile:
        if (self.robot is None) == (not self.robots):
            raise ValueError("give either one [robot] or several [[robots]]")
        return self

    @cached_property
    def _built(self) -> tuple[list[Robot], list[str]]:
        robots, names = [], []
        for number, entry in enumerate(self.robots or (self.robot,)):
            try:
                made = entry.build()
            except (ValueError, TypeError) as error:
                where = f"robots.{number}" if self.robots else "robot"
                raise ConfigError(f"{self._source}{where}: {error}") from None
            name = entry.name or entry.body.shape
            robots += made
            names += [name] if len(made) == 1 else [f"{name} {i + 1}" for i in range(len(made))]
        return robots, names

    def build_robots(self) -> list[Robot]:
        """Make the robots. Raises ConfigError, or OSError where a file is missing."""
        return self._built[0]

    @property
    def names(self) -> dict[int, str]:
        """What each robot is called; robots of one world are one, called as the scene."""
        if self.simulation.world == "together":
            return {0: self.name}
        return dict(enumerate(self._built[1]))

    def make_simulation(self) -> Simulation:
        """Make the simulation at its very start. Raises ConfigError."""
        settings = self.simulation.model_dump(exclude={"duration"})
        try:
            scene = self.scene.build()
        except (ValueError, TypeError) as error:
            raise ConfigError(f"{self._source}scene: {error}") from None
        robots = self.build_robots()
        try:
            return Simulation(robots, scene, **settings)
        except (ValueError, TypeError, NotImplementedError) as error:
            raise ConfigError(f"{self._source}simulation: {error}") from None

    def run(
        self,
        progress: Callable[[float], None] | None = None,
        watch: Callable[[Simulation, float], None] | None = None,
    ) -> Result:
        """Simulate it.

        Args:
            progress: Called now and then with the share that is done, 0 to 1.
            watch: Called as often, with the simulation too: `Simulation.so_far` gives the frames.

        Raises:
            ConfigError: Something in the file does not fit.
        """
        simulation, record = self.make_simulation(), self.record
        if wrong := [i for i in record.robots or () if not 0 <= i < len(simulation.robots)]:
            count = len(simulation.robots)
            raise ConfigError(f"{self._source}record.robots: {wrong[0]} given, there are {count}")

        def advance(done: float) -> None:
            if progress is not None:
                progress(done)
            if watch is not None:
                watch(simulation, done)

        duration = self.simulation.duration
        return simulation.run(duration, record.fps, record.robots, record.energy, advance)


def load_scene(
    path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None
) -> SceneFile:
    """Read a scene file.

    Args:
        path: A TOML file; the files that it names lie beside it.
        overrides: Dotted key -> value, e.g. {"scene.damping": 0.1, "robots.0.body.edge": 0.2};
            replaces what was read.

    Raises:
        ConfigError: There is no such file, or it does not describe a scene; one line that names
            the file and the key.
    """
    path = Path(path)
    text = read_text(path)
    scene = parse(SceneFile, text, str(path), overrides, folder=path.parent)
    scene._source = f"{path}: "
    return scene
