"""Sprouts: potted bodies of buds that go on growing while they are simulated, as light falls."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.bodies import build
from evolve.bodies.growth import Light, folded_pose, growing_springs
from evolve.encodings.base import EncodingSettings, Interval
from evolve.encodings.growth import GrowingBody, GrowthSettingsBase

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.bodies.cells import Cells
    from evolve.bodies.plan import Plan

__all__ = ["SproutEncoding", "SproutSettings"]

ROOT = 4
"""Masses of the base of the first cell: the pot, which does not grow."""
LEVEL, CONTRAST, PATIENCE, READINESS = range(4)
"""Genes of growth, after those of the rule: how much light moves it, the light of a corner above
that of its cell, how long a cell waits for the one that it grows on; and what is always added."""
STRONGEST = (6.0, 60.0, 6.0, 3.0)
"""Largest weight of each."""
LIMIT = 1.2
"""Largest growth of a corner; 1 is that of the plan."""
NOWHERE = (0.0, 0.0, 0.0)
"""Where the lamp is until the task says so."""


class SproutSettings(GrowthSettingsBase):
    """How buds grow, and how long the material lasts."""

    type: Literal["sprout"] = "sprout"
    mass: float = Field(10.0, gt=0.0)
    """Mass of every robot [kg]; it is there from the start, in the pot and in the buds."""
    pot: float = Field(0.9, ge=0.0, lt=1.0)
    """Share of the mass that is the pot: the base of the first cell, which stands on the ground."""
    material: float = Field(7.0, gt=0.0)
    """How many cells it suffices for: of buds that are more, only some grow."""
    bud: float = Field(0.4, gt=0.05, lt=1.0)
    """Size of a bud, as a part of the cell that it becomes; smaller ones may be squashed."""
    speed: float = Field(0.5, gt=0.0)
    """How much of a cell may grow in a second, at most [1/s]."""
    rate: float = Field(20.0, gt=0.0)
    """Readings of the light a second [1/s]."""
    response: float = Field(0.1, ge=0.0)
    """Time in which rest lengths come to 63 % of what has grown [s]: springs do not jump."""
    far: float = Field(1.0, gt=0.0)
    """Distance at which the light is half as bright [m]."""
    stiffness: Interval = (100.0, 1000.0)
    """Lowest and highest stiffness [N/m]; genes are its logarithm."""
    amplitude: float = Field(0.0, ge=0.0, lt=1.0)
    """Largest amplitude of the rest length, in initial lengths of the spring."""

    @property
    def sensors(self) -> tuple[str, ...]:
        """What it senses of the task."""
        return ("light",)


class SproutEncoding(GrowingBody):
    """A rule of growth, and four genes by which the light lets the corners of its cells grow.

    The rule makes a plan, heading up, by a lamp overhead. The robot begins as a seedling: its heavy
    pot stands on the ground, everything else is a bud of 0.4 of its size, at rest. Twenty
    times a second each corner reads the light at its place, and grows by

        tanh(level light + contrast (light - that of its cell) + patience (size of the cell that its
        own grows on - 1) + readiness)

    where that is positive, for good, and as long as the material of the whole plant lasts. A spring
    is as long as its two corners have grown. The work that this takes is in the ledger of energies;
    the mass of the buds is that of the grown plant.
    """

    Settings: ClassVar[type[EncodingSettings]] = SproutSettings
    settings: SproutSettings
    own_genes: ClassVar[int] = len(STRONGEST)

    def body(self, genome: np.ndarray) -> Cells:
        """The cells of one genome's plan, heading along x."""
        overhead = Light((1.0, 0.0, 0.0), self.settings.far)
        return self.grown(genome, overhead, material=np.inf, behind=-1e-9)

    def express(self, genomes: np.ndarray) -> list[ws.Robot]:
        """Build the seedlings."""
        return [self._seedling(np.asarray(genome, np.float64)) for genome in genomes]

    def _seedling(self, genome: np.ndarray) -> ws.Robot:
        cells = self.body(genome)
        plant = self._potted(build.robot(_upright(cells), self.settings))
        share = self.settings.bud
        pose = folded_pose(plant.positions, ROOT, share)
        full = plant.rest_length
        small = plant.replace(positions=pose)
        # At rest as it is, up to what its tissue makes longer or shorter.
        rest = small.lengths * full / plant.lengths
        small = small.replace(rest_length=rest, amplitude=share * plant.amplitude)
        return small.controlled(self._brain(cells, small, full, genome))

    def _potted(self, plant: ws.Robot) -> ws.Robot:
        """With the share of its mass that is the pot at its root."""
        share = self.settings.pot
        masses = (1.0 - share) * plant.masses
        masses[:ROOT] += share * plant.mass / ROOT
        return plant.replace(masses=masses)

    def _brain(
        self, cells: Cells, small: ws.Robot, full: np.ndarray, genome: np.ndarray
    ) -> ws.Controller:
        """What lets the corners grow."""
        import warp_springs as ws

        settings = self.settings
        springs, pairs = growing_springs(small.springs, ROOT)
        number = {tuple(sorted(pair)): i for i, pair in enumerate(small.springs.tolist())}
        rails = [number[tuple(sorted(corners[[0, 4]].tolist()))] for corners in cells.corners]
        ways = np.maximum(full / small.rest_length - 1.0, 0.1)[rails]
        return ws.Controller(
            sensors=[
                ws.sensors.light(np.arange(ROOT, small.n_masses), NOWHERE, settings.far),
                *(ws.sensors.length(*rail) for rail in zip(rails, ways, strict=True)),
            ],
            muscles=springs,
            outputs=pairs,
            # Few springs of a sharply bent cell would become much shorter: not by so much.
            reach=np.maximum(full[springs] / small.rest_length[springs] - 1.0, -0.6),
            weights=_weights(cells, genome[-self.own_genes :]).ravel(),
            hidden=0,
            rate=settings.rate,
            response=settings.response,
            growth=ws.Growth(settings.speed, LIMIT, budget=4.0 * settings.material),
        )


def _upright(cells: Cells) -> Plan:
    """The plan of a body with what was forward up."""
    plan = cells.plan()
    x, y, z = plan.positions.T
    return replace(plan, positions=np.stack([-z, y, x], axis=1))


def _weights(cells: Cells, genes: np.ndarray) -> np.ndarray:
    """Weights of the corners' network, (4 C, 4 C + C + 1): light of corners, size of cells, 1."""
    level, contrast, patience, readiness = (2.0 * genes - 1.0) * STRONGEST
    count = len(cells)
    weights = np.zeros((4 * count, 5 * count + 1))
    corner = np.arange(4 * count)
    cell = corner // 4
    weights[corner, corner] = level + contrast
    weights[:, : 4 * count] -= 0.25 * contrast * (cell[:, None] == cell)
    parents = np.array(cells.parents)[cell]
    waits = parents >= 0
    weights[corner[waits], 4 * count + parents[waits]] = patience
    weights[:, -1] = readiness - patience * waits
    return weights
