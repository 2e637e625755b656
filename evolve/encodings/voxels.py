"""Voxels: which cubes of a lattice exist, what each is made of, and when it breathes."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from evolve.bodies.lattice import Lattice
from evolve.encodings.base import ArrayGenomes, EncodingSettings, folded
from evolve.encodings.evolving import EvolvingBody, WeightSettings

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["VoxelBody", "VoxelBodySettings", "VoxelsEncoding", "VoxelsSettings"]

PRESENCE, MATERIAL, PHASE = range(3)
"""Columns of a genome."""


class VoxelBodySettings(WeightSettings):
    """The lattice from which bodies are cut, and what voxels may be made of."""

    cells: tuple[int, int, int] = (4, 3, 3)
    """Most voxels along x, y and z."""
    edge: float = Field(0.1, gt=0.0)
    """Length of a voxel's edge [m]."""
    least_voxels: int = Field(4, ge=1)
    """Bodies with fewer are filled up, cube by cube, where they come nearest to being."""
    soft: float = Field(1000.0, gt=0.0)
    """Stiffness of tissue [N/m]."""
    hard: float = Field(20000.0, gt=0.0)
    """Stiffness of bone [N/m]."""
    muscle: float = Field(5000.0, gt=0.0)
    """Stiffness of muscle [N/m]."""
    amplitude: float = Field(0.2, ge=0.0, lt=1.0)
    """Amplitude of muscle, in lengths of the spring."""

    @model_validator(mode="after")
    def _is_a_lattice(self) -> VoxelBodySettings:
        voxels = int(np.prod(self.cells))
        if min(self.cells) < 1 or voxels > 4096:
            raise ValueError(f"cells: {list(self.cells)} given, 1 to 4096 voxels expected")
        if self.least_voxels > voxels:
            raise ValueError(f"least_voxels: {self.least_voxels} given, there are {voxels}")
        return self


class VoxelBody(EvolvingBody):
    """A body cut from a lattice, each of its voxels tissue, bone or muscle."""

    settings: VoxelBodySettings

    def __init__(self, body: None, settings: VoxelBodySettings) -> None:
        self.settings = settings
        self.lattice = Lattice(settings.cells, settings.edge)

    def masks(self, presence: np.ndarray) -> np.ndarray:
        """Which voxels exist: the largest connected part of those above zero, (n, V), bool.

        A body with too few gets those of its neighbours that come nearest.
        """
        lattice, most = self.lattice, presence.argmax(axis=1)
        masks = lattice.connected(presence > 0.0, most)
        while len(few := np.flatnonzero(masks.sum(axis=1) < self.settings.least_voxels)):
            beside = lattice.beside(masks[few])
            best = np.where(beside, presence[few], -np.inf).argmax(axis=1)
            masks[few, best] = True
        return masks

    def grown(
        self, presence: np.ndarray, material: np.ndarray, phase: np.ndarray
    ) -> list[ws.Robot]:
        """The robots of n patterns over the lattice.

        Args:
            presence: Above zero where a voxel is, shape (n, V).
            material: 0 to 1/4 tissue, to 1/2 bone, beyond muscle, shape (n, V).
            phase: When muscle is longest [cycles], shape (n, V).
        """
        settings = self.settings
        kind = np.minimum((material * 4.0).astype(np.int64), 2)
        stiffness = np.array([settings.soft, settings.hard, settings.muscle])[kind]
        swing = settings.amplitude * (kind == 2) * np.exp(2j * np.pi * phase)
        return self.lattice.robots(
            self.masks(presence), stiffness, swing, settings.weight, settings.period
        )


class VoxelsSettings(VoxelBodySettings):
    """How much of a body a mutation changes."""

    type: Literal["voxels"] = "voxels"
    mutation_rate: float = Field(0.08, gt=0.0, le=1.0)
    """Share of the genes that a mutation changes, on average."""
    mutation_step: float = Field(0.2, gt=0.0)
    """Standard deviation of a mutation, as a share of a gene's range."""
    body_rate: float = Field(0.3, ge=0.0, le=1.0)
    """Share of the mutations that may change the body; the others leave it time to learn."""


class VoxelsEncoding(VoxelBody, ArrayGenomes):
    """Presence, material and phase of every voxel.

    A genome has shape (V, 3), float32, in [0, 1]; a voxel exists where its presence is above one
    half and it hangs together with the largest part of the body.
    """

    Settings: ClassVar[type[EncodingSettings]] = VoxelsSettings
    settings: VoxelsSettings

    def __init__(self, body: None, settings: VoxelsSettings) -> None:
        super().__init__(body, settings)
        self.genome_shape = (self.lattice.size, 3)
        self.circular = np.array([False, False, True])

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n bodies: smooth blobs, each with a wave of phases through it."""
        genomes = rng.random((n, *self.genome_shape), dtype=np.float32)
        places = self.lattice.centres / self.settings.edge
        for column in range(3):
            # Voxels near each other begin alike: one plane wave, and some noise on top.
            waves = rng.standard_normal((n, 3)) * 0.12
            course = np.einsum("vi,ni->nv", places, waves) + rng.random((n, 1))
            if column != PHASE:
                course = 0.5 + 0.35 * np.sin(2.0 * np.pi * course)
            mixed = course + 0.3 * (genomes[:, :, column] - 0.5)
            genomes[:, :, column] = folded(mixed, column == PHASE)
        return genomes

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change material and phase of some voxels of every body; add or remove some, at times."""
        rate, rows = self.settings.mutation_rate, np.arange(len(genomes))
        masks = self.masks(genomes[:, :, PRESENCE] - 0.5)
        changed = self._tuned(genomes, masks, rng)
        # What may come or go: the voxels of the body and those beside it.
        shapes = rng.random(len(rows)) < self.settings.body_rate
        near = masks | self.lattice.beside(masks)
        flips = near & (rng.random(near.shape) < 0.5 * rate)
        flips[rows, _one_of(near, rng)] = True
        flips &= shapes[:, None]
        changed[:, :, PRESENCE][flips] = 1.0 - changed[:, :, PRESENCE][flips]
        return changed

    def tune(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change material and phase of some voxels of every body."""
        return self._tuned(genomes, self.masks(genomes[:, :, PRESENCE] - 0.5), rng)

    def _tuned(
        self, genomes: np.ndarray, masks: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Change material and phase of some voxels of the bodies that masks (n, V) show.

        Genes of absent voxels and phases of bone say nothing, so at least one voxel that exists
        changes its material, or, as a muscle, its phase.
        """
        settings, rows = self.settings, np.arange(len(genomes))
        chosen = rng.random(genomes.shape, dtype=np.float32) < settings.mutation_rate
        chosen[:, :, PRESENCE] = False
        one = _one_of(masks, rng)
        times = (genomes[rows, one, MATERIAL] >= 0.5) & (rng.random(len(rows)) < 0.7)
        chosen[rows, one, PHASE] = times
        shift = rng.standard_normal(genomes.shape, dtype=np.float32) * settings.mutation_step
        changed = folded(genomes + (shift * chosen).astype(np.float32), self.circular)
        # Half the range further is another material.
        other = genomes[rows, one, MATERIAL] + 0.5
        changed[rows, one, MATERIAL] = np.where(
            times, changed[rows, one, MATERIAL], other - np.floor(other)
        )
        return changed

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take the voxels on one side of a plane from a[i], those on the other from b[i]."""
        centres = self.lattice.centres
        normals = rng.standard_normal((len(a), 3))
        through = centres[rng.integers(len(centres), size=len(a))]
        side = np.zeros((len(a), len(centres)))
        for axis in range(3):
            side += (centres[:, axis] - through[:, axis, None]) * normals[:, axis, None]
        return np.where(side[:, :, None] > 0.0, a, b)

    def express(self, genomes: np.ndarray) -> list[ws.Robot]:
        """Build the robots."""
        genes = np.asarray(genomes, np.float64)
        return self.grown(genes[:, :, PRESENCE] - 0.5, genes[:, :, MATERIAL], genes[:, :, PHASE])

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Share of the voxels that only one has, or that differ in kind or phase, shape (n,)."""
        gap = np.abs(a.astype(np.float64) - b)
        gap[:, :, PHASE] = 2.0 * np.minimum(gap[:, :, PHASE], 1.0 - gap[:, :, PHASE])
        # Unrelated genes are a third apart, phases a half.
        return (gap.mean(axis=1) * (3.0, 3.0, 2.0)).mean(axis=1)


def _one_of(masks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One of the voxels in each mask, shape (n, V) -> (n,)."""
    return np.where(masks, rng.random(masks.shape), -1.0).argmax(axis=1)
