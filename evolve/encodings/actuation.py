"""What encodings of a fixed body share: bounds of the actuation, symmetry, and the expression."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import EncodingSettings, Genomes, Interval

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["ActuationSettings", "FixedBody"]

AXES = {"x": 0, "y": 1}
OWN = ("rest_length", "amplitude", "phase", "stiffness", "material")
"""Fields that a body has too."""


class ActuationSettings(EncodingSettings):
    """What the springs of a fixed body may do, and how much a mutation changes.

    The same for every encoding, so that a run changes its encoding by one word.
    """

    rest_length: Interval = (0.9, 1.1)
    """Lowest and highest mean rest length, in initial lengths of the spring."""
    amplitude: float = Field(0.25, ge=0.0)
    """Largest amplitude of the rest length, in initial lengths of the spring."""
    stiffness: Interval = (1000.0, 20000.0)
    """Lowest and highest stiffness [N/m]; genes are its logarithm."""
    muscles: Literal["all", "cables"] = "all"
    """Which springs have genes; the others stay as the body has them."""
    symmetry: Literal["none", "x", "y"] = "none"
    """Axis along which the two halves of the body mirror each other and share their genes."""
    symmetry_phase: float = 0.5
    """How far the second half is behind the first [cycles]."""
    mutation_rate: float = Field(0.1, gt=0.0, le=1.0)
    """Share of the genes, or springs, that a mutation changes, on average."""
    mutation_step: float = Field(0.15, gt=0.0)
    """Standard deviation of a mutation, as a share of a gene's range."""


class FixedBody:
    """One body whose springs are controlled: which of them have genes, where those are.

    With a symmetry only one of two mirrored springs has genes; the other does the same later.

    Attributes:
        body: The body.
        own: Springs that have genes, shape (R,).
        middles: Where these are [m], shape (R, 3).
        places: The same, measured from the middle of the body in units of half its extent: within
            [-1, 1] along the longest axis, shape (R, 3).
    """

    fixed_body: ClassVar[bool] = True
    needs_body: ClassVar[bool] = True

    def __init__(self, body: ws.Robot, settings: ActuationSettings) -> None:
        if body.n_springs == 0:
            raise ValueError("an encoding of springs needs a body with springs; this one has none")
        self.body, self.settings = body, settings
        partner = np.arange(body.n_springs)
        if settings.symmetry != "none":
            partner = mirror_images(body, AXES[settings.symmetry])
        middles = body.positions[body.springs].mean(axis=1)
        self._passive = np.flatnonzero(~muscles(body, settings.muscles))
        first = partner >= np.arange(body.n_springs)  # of a pair, the one that is listed first
        self._later = np.where(first, 0.0, settings.symmetry_phase)
        own = first & muscles(body, settings.muscles)
        self.own = np.flatnonzero(own)
        row = np.maximum(np.cumsum(own) - 1, 0)  # what passive springs look up is not used
        self._row = np.where(first, row, row[partner])
        self.middles = middles[self.own]
        low, high = body.bounds
        half = max(float((high - low).max()) / 2.0, np.finfo(float).tiny)
        self.places = (self.middles - (low + high) / 2.0) / half

    def tune(self, genomes: Genomes, rng: np.random.Generator) -> Genomes:
        """Make one changed copy of every genome: none of them says anything about the body."""
        return self.mutate(genomes, rng)

    def actuated(
        self,
        rest: np.ndarray,
        amplitude: np.ndarray,
        phase: np.ndarray,
        stiffness: np.ndarray,
        **more: np.ndarray,
    ) -> ws.Variants:
        """The robots of n controllers, L0(t) = a + b sin(2 pi t / period + c).

        Args:
            rest: Mean rest length, 0 to 1 within its bounds, shape (n, R).
            amplitude: 0 to 1 of the largest amplitude, shape (n, R).
            phase: [cycles], shape (n, R).
            stiffness: Logarithm of the stiffness, 0 to 1 within its bounds, shape (n, R).
            more: Further fields of `ws.Variants`.
        """
        settings, lengths = self.settings, self.body.lengths
        (low, high), (soft, hard) = settings.rest_length, settings.stiffness
        rests = self._spread(rest)
        rests *= (high - low) * lengths
        rests += low * lengths
        reaches = self._spread(amplitude)
        reaches *= settings.amplitude * lengths
        phases = self._spread(phase)
        if self._later.any():
            phases += self._later
        phases *= 2.0 * np.pi
        stiffnesses = self._spread(stiffness)
        stiffnesses *= np.log(hard / soft)
        stiffnesses += np.log(soft)
        return self.variants(
            rest_length=rests,
            amplitude=reaches,
            phase=phases,
            stiffness=np.exp(stiffnesses, out=stiffnesses),
            omega=np.full(len(rest), 2.0 * np.pi / settings.period),
            **more,
        )

    def _spread(self, values: np.ndarray) -> np.ndarray:
        """As `spread`, in float64, to be written to."""
        return np.array(self.spread(values), np.float64)

    def variants(self, **fields: np.ndarray) -> ws.Variants:
        """The robots of fields of `ws.Variants`, whose passive springs are those of the body."""
        passive = self._passive
        for name, value in fields.items() if len(passive) else ():
            if name not in ("omega", "weights"):
                value = fields[name] = np.array(value)
                value[:, passive] = getattr(self.body, name)[passive] if name in OWN else 0.0
        return self.body.variants(copy=False, **fields)

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Values of the springs that have genes, (n, R, ...), for every spring, (n, S, ...)."""
        values = np.asarray(values)
        return values if len(self.own) == self.body.n_springs else values[:, self._row]

    def spread_phase(self, phase: np.ndarray, order: int = 1) -> np.ndarray:
        """Phases of a harmonic [cycles], (n, R), for every spring, (n, S): mirrored ones later."""
        later = order * self._later
        return self.spread(phase) + later if later.any() else self.spread(phase)

    def balls(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """For each of n genomes, the springs within a ball about one of them: (n, R), bool."""
        middles = self.middles.astype(np.float32)
        centres = middles[rng.integers(len(self.own), size=n)]
        reach = 0.5 * float(np.linalg.norm(np.ptp(self.middles, axis=0)))
        radii = reach * rng.random((n, 1), dtype=np.float32)
        inside = np.empty((n, len(self.own)), bool)
        for rows in self._pieces(n):
            x, y, z = (middles[:, i] - centres[rows, i, None] for i in range(3))
            for way in (x, y, z):
                way *= way
            x += y
            x += z
            np.less_equal(x, radii[rows] ** 2, out=inside[rows])
        return inside

    def half_spaces(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """For each of n pairs, the springs on one side of a plane through the body: (n, R)."""
        middles = self.middles.astype(np.float32)
        normals = rng.standard_normal((n, 3), dtype=np.float32)
        through = middles[rng.integers(len(self.own), size=n)]
        beyond = np.empty((n, len(self.own)), bool)
        for rows in self._pieces(n):
            # Written out: a matrix product might add up differently on another number of threads.
            x, y, z = (middles[:, i] * normals[rows, i, None] for i in range(3))
            x += y
            x += z
            a, b, c = (through[rows] * normals[rows]).T
            np.greater(x, (a + b + c)[:, None], out=beyond[rows])
        return beyond

    def _pieces(self, n: int) -> Iterator[slice]:
        """n genomes, a few at a time: their springs fit the cache."""
        step = max(1, 32768 // len(self.own))
        return (slice(first, first + step) for first in range(0, n, step))


def muscles(body: ws.Robot, which: str) -> np.ndarray:
    """Which springs are muscles, shape (S,), bool.

    Raises:
        ValueError: The body has none.
    """
    if which == "all":
        return np.ones(body.n_springs, bool)
    slope = body.elements.slope
    if slope is None or not (slope == 0.0).any():
        raise ValueError("muscles: the body has no cables")
    return slope == 0.0


def mirror_images(body: ws.Robot, axis: int) -> np.ndarray:
    """The mirror image of each spring in the plane through the middle of the body, shape (S,).

    Raises:
        ValueError: The body is not its own mirror image.
    """
    low, high = body.bounds
    mirrored = body.positions.copy()
    mirrored[:, axis] = low[axis] + high[axis] - mirrored[:, axis]
    tolerance = 1e-6 * max(float((high - low).max()), np.finfo(float).tiny)
    image = _matches(body.positions, mirrored, tolerance)
    ends = np.sort(image[body.springs], axis=1)
    known = {tuple(pair): s for s, pair in enumerate(np.sort(body.springs, axis=1).tolist())}
    found = [known.get(tuple(pair), -1) for pair in ends.tolist()]
    if (image < 0).any() or -1 in found:
        name = "xy"[axis]
        raise ValueError(f"symmetry: the body is not its own mirror image along {name}")
    return np.array(found)


def _matches(points: np.ndarray, wanted: np.ndarray, tolerance: float) -> np.ndarray:
    """Index of the point where each wanted one is, shape (M,); -1 for none."""
    cells = np.round(points / (4.0 * tolerance)).astype(np.int64)
    where: dict[Any, list[int]] = {}
    for index, cell in enumerate(map(tuple, cells.tolist())):
        where.setdefault(cell, []).append(index)
    found = np.full(len(wanted), -1)
    steps = np.stack(np.meshgrid(*[(-1, 0, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for index, point in enumerate(wanted):
        home = np.round(point / (4.0 * tolerance)).astype(np.int64)
        for step in steps:
            for other in where.get(tuple((home + step).tolist()), ()):
                if np.abs(points[other] - point).max() <= tolerance:
                    found[index] = other
    return found
