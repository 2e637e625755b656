"""Robot: masses, springs and faces as read-only NumPy arrays, and what one does with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.connections import Connections
from warp_springs.body.elements import NONE, Elements
from warp_springs.body.fields import FIELDS, settled
from warp_springs.body.placing import Placing
from warp_springs.body.tensions import rest_length_at, tension
from warp_springs.body.verbs import Verbs
from warp_springs.geometry import (
    FloatArray,
    IntArray,
    largest_distance,
    spring_lengths,
)

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    from warp_springs.body.variants import Variants
    from warp_springs.materials import Material, Region

__all__ = ["Robot", "made"]


class Robot(Placing, Verbs):
    """A body of point masses and springs, with a sinusoidal rest length for every spring.

    Immutable: every array is read-only and C-contiguous, every method returns a new robot that
    shares what it did not change. The rest length in time is
    ``L0(t) = rest_length + amplitude * sin(omega * t + phase)``.

    Args:
        masses: Mass of each point [kg], shape (M,) or one number, positive.
        positions: Initial positions [m], shape (M, 3), M >= 1; z is up.
        springs: Indices of the two masses that each spring joins, shape (S, 2), S >= 0.
        stiffness: Spring stiffness [N/m], shape (S,) or one number, positive.
        rest_length: Mean rest length [m], shape (S,) or one number, not negative; the initial
            lengths when left out.
        velocities: Initial velocities [m/s], shape (M, 3); zero when left out.
        amplitude: Amplitude of the rest length [m], shape (S,) or one number; zero when left out.
        phase: Phase of the rest length [rad], shape (S,) or one number; zero when left out.
        omega: Angular frequency of the actuation [rad/s], one number for the robot.
        faces: Corners of the exterior triangles, counter-clockwise seen from outside, shape
            (T, 3); none when left out.
        material: Row of ``materials`` that each spring is made of, -1 for none, shape (S,); none
            when left out. See `made_of`.
        materials: The materials that springs are made of.
        elements: Cables, harmonics, dashpots, pushes, constraints and more, made by the verbs of
            a robot (`with_cables`, `pushed`, `fixed`, ...); none when left out.

    Raises:
        ValueError: An array is malformed: the message names the field, the first bad index, what
            was given and what is allowed. Unwise bodies (coincident masses, two springs between
            one pair, an amplitude above the rest length) are allowed.
    """

    __slots__ = (*FIELDS, "_connections", "elements")

    masses: FloatArray
    positions: FloatArray
    velocities: FloatArray
    springs: IntArray
    stiffness: FloatArray
    rest_length: FloatArray
    amplitude: FloatArray
    phase: FloatArray
    omega: float
    faces: IntArray
    material: IntArray
    materials: tuple[Material, ...]
    elements: Elements

    def __init__(
        self,
        *,
        masses: ArrayLike,
        positions: ArrayLike,
        springs: ArrayLike,
        stiffness: ArrayLike,
        rest_length: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        amplitude: ArrayLike | None = None,
        phase: ArrayLike | None = None,
        omega: float = 0.0,
        faces: ArrayLike | None = None,
        material: ArrayLike | None = None,
        materials: Sequence[Material] = (),
        elements: Elements | None = None,
    ) -> None:
        given = {
            "masses": masses,
            "positions": positions,
            "velocities": velocities,
            "springs": springs,
            "stiffness": stiffness,
            "rest_length": rest_length,
            "amplitude": amplitude,
            "phase": phase,
            "omega": omega,
            "faces": faces,
            "material": material,
            "materials": materials,
        }
        _assign(self, settled(given, FIELDS), _checked_elements(elements))

    # -- what a robot is ---------------------------------------------------------------------

    @property
    def n_masses(self) -> int:
        """Number of masses M."""
        return len(self.masses)

    @property
    def n_springs(self) -> int:
        """Number of springs S."""
        return len(self.springs)

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(self.masses.sum())

    @property
    def center_of_mass(self) -> FloatArray:
        """Centre of mass [m], shape (3,)."""
        return self.masses @ self.positions / self.masses.sum()

    @property
    def lengths(self) -> FloatArray:
        """Initial length of each spring [m], shape (S,)."""
        return spring_lengths(self.positions, self.springs)

    @property
    def bounds(self) -> FloatArray:
        """Lowest and highest corner of the bounding box [m], shape (2, 3)."""
        return np.stack([self.positions.min(axis=0), self.positions.max(axis=0)])

    @property
    def diameter(self) -> float:
        """Largest distance between two masses [m]."""
        return largest_distance(self.positions)

    @property
    def volume(self) -> float:
        """Volume inside the faces [m^3], by the divergence theorem; 0 without faces.

        Meaningful where the faces are closed and turn outward, as those of the shapes do.
        """
        a, b, c = (self.positions - self.positions.mean(axis=0))[self.faces].transpose(1, 0, 2)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    @property
    def is_actuated(self) -> bool:
        """Whether any spring has an amplitude, or harmonics, other than zero."""
        harmonics = self.elements.harmonics
        return bool(self.amplitude.any()) or (harmonics is not None and bool(harmonics.any()))

    @property
    def topology(self) -> bytes:
        """Key of the number of masses and of the springs in their order.

        Two robots have the same key exactly when they have as many masses and the same springs
        in the same order. Computed once for all robots that share a springs array.
        """
        return self._connections.key

    def rest_length_at(self, t: ArrayLike) -> FloatArray:
        """Rest lengths at a time [m]: shape (S,) for one time [s], (F, S) for times (F,)."""
        return rest_length_at(self, t)

    def tension(
        self, positions: ArrayLike, t: ArrayLike, change: FloatArray | None = None
    ) -> FloatArray:
        """Force in each spring [N], positive where stretched: Hooke's law k (L - L0(t)), or what
        the elements of the robot make of it; without dashpots. `Result.tension` is that of a run.

        Args:
            positions: Positions [m], shape (M, 3) with one time, (F, M, 3) with times (F,).
            t: The time [s] or the times of the frames, shape (F,).
            change: By how much rest lengths are longer than `rest_length_at` says [m], (S,) or
                (F, S): what controllers ask for and how far springs have yielded.

        Returns:
            Forces, shape (S,) or (F, S).

        Raises:
            ValueError: The shapes of the positions and of the times do not fit.
        """
        positions, t = np.asarray(positions, np.float64), np.asarray(t, np.float64)
        expected = (*t.shape, self.n_masses, 3)
        if positions.shape != expected:
            raise ValueError(
                f"positions: shape {positions.shape} given, {expected} expected for times of "
                f"shape {t.shape} and {self.n_masses} masses"
            )
        return tension(self, spring_lengths(positions, self.springs), t, change)

    # -- new robots from this one ------------------------------------------------------------

    def replace(self, **fields: Any) -> Robot:
        """The same robot with some fields replaced; None asks for the default of the field.

        Replaced positions do not change the rest lengths: give ``rest_length=None`` for the new
        initial lengths.

        Raises:
            TypeError: A robot has no such field.
            ValueError: A new array is malformed or no longer fits the others.
        """
        elements = _checked_elements(fields.pop("elements", self.elements))
        for name in fields:
            if name not in FIELDS:
                raise TypeError(f"a robot has no field {name!r}; it has {', '.join(FIELDS)}")
        kept = {name: getattr(self, name) for name in FIELDS}
        if "springs" in fields and not self.materials:
            kept["material"] = None  # nothing is lost, and any number of springs may come
        # Kept arrays are known to be good unless the counts or the springs under them change.
        same_body = "springs" not in fields and (
            "positions" not in fields or np.shape(fields["positions"]) == self.positions.shape
        )
        robot = object.__new__(Robot)
        values = settled(kept | fields, fields.keys() if same_body else FIELDS)
        _assign(robot, values, elements, self._connections if same_body else None)
        return robot

    def made_of(self, material: Material, where: Region | None = None) -> Robot:
        """The robot with all springs, or some, made of a material.

        They get its stiffness (for bars E A / L, L the rest length), its breathing (amplitude
        strain * rest_length, and phase), and its label in ``material``. Masses stay: see
        `weighed`. A robot without an omega gets the course's 2 pi rad/s with its first muscle.

        Args:
            material: One of ``ws.materials`` or a ``ws.Material`` of your own.
            where: Which springs: a mask (S,), indices, the lowest and highest corner of a box
                around their middles, (2, 3) real numbers [m], or a function of the middles (S, 3)
                [m] that returns one of these; all when left out.

        Raises:
            ValueError: The region is malformed, or a bar has no length.
            TypeError: The material is none.
        """
        from warp_springs.materials import apply

        return apply(self, material, where)

    def weighed(self) -> Robot:
        """The robot with the masses that follow from its materials, all of which need a density.

        Bars (materials with a section) weigh density * section * rest_length, half at each end.
        Other springs share the volume inside the faces evenly, each filling its part with its
        density, half of it at each end.

        Raises:
            ValueError: A spring has no material, a material has no density, only some materials
                have a section, or none has and the faces enclose no volume.
        """
        from warp_springs.materials import weigh

        return weigh(self)

    def joined(self, other: Robot, merge: bool = False, tolerance: float = 1e-9) -> Robot:
        """This robot and another as one body: this one's masses and springs come first.

        With ``merge`` the two bodies grow together. A mass of the other that lies within the
        tolerance of a mass of this one becomes that mass: it keeps this one's position and
        velocity and the LARGER of the two masses, not their sum, as a vertex shared by the
        voxels of a lattice exists once. Of the springs between one pair of masses the first
        stays, this robot's before the other's. Two coincident triangles with opposite winding,
        one of each body, are interior now and vanish; of two with the same winding one stays.
        Springs and faces that the tolerance collapses to a point or a line vanish too.

        Only what one body has in common with the other is merged: duplicates inside one body
        stay, its coincident masses and its repeated triangles alike. Where several masses of
        the other coincide with one mass of this one, all of them become that mass. Springs are
        the exception: of those that one body repeats between a pair, too, the first stays.

        Args:
            other: The other body.
            merge: Whether coincident masses become one.
            tolerance: Largest distance [m] at which two masses coincide, at least 0.

        Raises:
            ValueError: Both robots are actuated with different omegas (a robot has one), or the
                tolerance is negative or not finite.
        """
        from warp_springs.body.joining import join

        return join(self, other, merge, tolerance)

    def variants(self, *, copy: bool = True, **stacked: ArrayLike) -> Variants:
        """N robots that share this body and differ in some fields: see `Variants`.

        With ``copy=False`` arrays of float64 are not copied where that can be avoided, but made
        read-only: for whoever made them for these robots alone.
        """
        from warp_springs.body.variants import Variants

        return Variants(self, stacked, copy)

    # -- files --------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write everything that the robot is to one ``.npz``; see `warp_springs.io.robots`.

        A file that is there is replaced once the new one is complete.

        Raises:
            ValueError: The name does not end in ``.npz``.
            OSError: The file cannot be written.
        """
        from warp_springs.io.robots import save_robot

        return save_robot(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Robot:
        """Read a robot that `save` wrote; it is equal to that one.

        Raises:
            OSError: There is no such file, or it cannot be read.
            ValueError: It is damaged, holds something else, or is of another version; the message
                names the file.
        """
        from warp_springs.io.robots import load_robot

        return load_robot(path)

    # -- a value among values ----------------------------------------------------------------

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a Robot is immutable: use robot.replace({name}=...)")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"a Robot is immutable: {name!r} cannot be deleted")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Robot):
            return NotImplemented
        same = all(np.array_equal(getattr(self, name), getattr(other, name)) for name in _ARRAYS)
        return same and self.materials == other.materials and self.elements == other.elements

    def __hash__(self) -> int:
        # Adding 0 turns -0.0 into 0.0: the two are equal, so they must hash alike.
        arrays = ((getattr(self, name) + np.zeros(1)).tobytes() for name in _ARRAYS)
        return hash((self.materials, self.elements, *arrays))

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, ({name: getattr(self, name) for name in (*FIELDS, "elements")},)

    def __repr__(self) -> str:
        actuated = f", actuated at {self.omega:.4g} rad/s" if self.is_actuated else ""
        return (
            f"Robot({self.n_masses} masses, {self.n_springs} springs, {len(self.faces)} faces, "
            f"{self.mass:.4g} kg{actuated})"
        )


_ARRAYS = tuple(name for name, field in FIELDS.items() if field.rule != "table")


def _checked_elements(elements: Elements | None) -> Elements:
    if elements is None:
        return NONE
    if not isinstance(elements, Elements):
        raise TypeError(f"elements: got {type(elements).__name__}, expected Elements")
    return NONE if elements == NONE else elements


def _assign(
    robot: Robot, values: dict[str, Any], elements: Elements, same: Connections | None = None
) -> None:
    for name, value in values.items():
        object.__setattr__(robot, name, value)
    connections = same or Connections(len(values["masses"]), values["springs"])
    if elements is not NONE:
        elements.check(len(values["masses"]), len(values["springs"]))
    object.__setattr__(robot, "_connections", connections)
    object.__setattr__(robot, "elements", elements)


def made(values: dict[str, Any], elements: Elements) -> Robot:
    """A robot of fields that are all checked and frozen."""
    robot = object.__new__(Robot)
    _assign(robot, values, elements)
    return robot


def _rebuilt(fields: dict[str, Any]) -> Robot:
    return Robot(**fields)
