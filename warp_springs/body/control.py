"""Controller: sensors, a small network, and the muscles whose rest lengths it sets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.checks import check_number
from warp_springs.geometry import FloatArray
from warp_springs.sensors import TARGETS, Sensor, triple

__all__ = ["Controller", "Growth", "body_frame"]


@dataclass(frozen=True)
class Growth:
    """Outputs of a controller as the speed of growth, which is never undone.

    An output o > 0 adds o ``speed`` a second to its growth, from 0 to ``limit``; as long as the
    material lasts: of what the outputs ask for beyond the ``budget`` each gets the same part.

    Attributes:
        speed: Growth at an output of 1 [1/s].
        limit: Largest growth of one output.
        budget: Largest sum of the growths of all outputs.
    """

    speed: float = 0.5
    limit: float = 1.0
    budget: float = math.inf

    def __post_init__(self) -> None:
        check_number("Growth.speed", self.speed, above=0.0)
        check_number("Growth.limit", self.limit, above=0.0)
        if not self.budget >= 0.0:
            raise ValueError(f"Growth.budget: got {self.budget!r}, expected 0 or more")


@dataclass(frozen=True, eq=False)
class Controller:
    """Closed loop: sensors -> network -> rest lengths, ``rate`` times a second.

    Hidden neurons are tanh of a weighted sum of the readings, of 1, and, in a recurrent network, of
    what they were the time before; outputs are tanh of a weighted sum of the hidden neurons and
    of 1, or of the readings and 1 where there are none. A muscle has the mean rest length
    ``rest_length (1 + reach a)``; a rhythm of its own comes on top. Its activation a is the output
    of the latest reading, or follows it with a lag, ``response da/dt = output - a`` from a = 0 on.
    With a ``growth`` the growth of an output takes the place of the output.

    Attributes:
        sensors: What it reads, in this order: see `ws.sensors`.
        muscles: Springs that it drives, shape (m,).
        weights: All weights, shape (n_weights,): rows (H, readings [+ H] + 1) into the hidden
            neurons, then rows (outputs, H + 1) out of them, the last of each row is that of 1;
            zero when left out, which leaves the muscles at rest.
        outputs: Which output each muscle obeys, shape (m,), or which two, the mean of which it
            obeys, shape (m, 2); one for each when left out.
        reach: Largest change of a rest length, as a part of it, less than 1: one number for all, or
            one for each muscle, shape (m,), negative for muscles that do the opposite. Of a growing
            muscle the change at a growth of 1, of any size.
        hidden: Hidden neurons H, 0 for a network of one layer.
        recurrent: Whether the hidden neurons remember.
        rate: Readings a second [1/s]; rounded so that whole steps lie between them.
        response: Time in which activations come to 63 % of a new output [s]; 0 for at once. They
            change in steps of an eighth of it, or less, each the mean of the lag over its time.
        growth: A `Growth`, or None: rest lengths are set anew with each reading.
        frame: Set by `Robot.controlled`: parts by which the masses make up the centre of mass,
            forward and left, shape (3, M).

    Raises:
        ValueError: A number is out of range, a shape does not fit, nothing is sensed or driven.
    """

    sensors: tuple[Sensor, ...]
    muscles: tuple[int, ...]
    weights: FloatArray = None  # type: ignore[assignment]  # an array once it is made
    outputs: tuple[int, ...] | tuple[tuple[int, int], ...] = None  # type: ignore[assignment]
    reach: float | tuple[float, ...] = 0.2
    hidden: int = 8
    recurrent: bool = False
    rate: float = 20.0
    response: float = 0.0
    growth: Growth | None = None
    frame: FloatArray | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        sensors = (self.sensors,) if isinstance(self.sensors, Sensor) else tuple(self.sensors)
        put(self, "sensors", sensors)
        if not sensors or not all(isinstance(sensor, Sensor) for sensor in sensors):
            raise ValueError(f"Controller.sensors: got {self.sensors!r}, expected ws.sensors")
        put(self, "muscles", _indices("muscles", self.muscles))
        given = range(len(self.muscles)) if self.outputs is None else self.outputs
        put(self, "outputs", _outputs(given))
        if len(self.outputs) != len(self.muscles):
            raise ValueError(
                f"Controller.outputs: {len(self.outputs)} given for {len(self.muscles)} muscles"
            )
        if len(set(self.muscles)) != len(self.muscles):
            raise ValueError("Controller.muscles: a spring is named twice")
        check_number("Controller.rate", self.rate, above=0.0)
        check_number("Controller.response", self.response, at_least=0.0)
        if self.growth is not None and not isinstance(self.growth, Growth):
            raise ValueError(f"Controller.growth: got {self.growth!r}, expected a Growth or None")
        put(self, "reach", self._checked_reach())
        if isinstance(self.hidden, bool) or int(self.hidden) != self.hidden or self.hidden < 0:
            raise ValueError(f"Controller.hidden: got {self.hidden!r}, expected 0 or more neurons")
        if self.recurrent and not self.hidden:
            raise ValueError("Controller.recurrent: there are no hidden neurons to remember")
        weights = np.zeros(self.n_weights) if self.weights is None else self.weights
        put(self, "weights", self.checked(weights))

    @property
    def n_readings(self) -> int:
        """Numbers that its sensors give."""
        return sum(sensor.readings for sensor in self.sensors)

    @property
    def n_outputs(self) -> int:
        """Outputs of the network."""
        return int(np.max(self.outputs)) + 1

    @property
    def n_weights(self) -> int:
        """Weights of the network."""
        into = self.n_readings + 1
        if not self.hidden:
            return self.n_outputs * into
        into += self.hidden if self.recurrent else 0
        return self.hidden * into + self.n_outputs * (self.hidden + 1)

    def _checked_reach(self) -> float | tuple[float, ...]:
        """The reach as a number, or one for each muscle; a ValueError where it is neither."""
        try:
            reach = np.asarray(self.reach, np.float64)
        except (TypeError, ValueError):
            reach = np.full(0, np.nan)
        if reach.shape not in ((), (len(self.muscles),)) or not np.isfinite(reach).all():
            raise ValueError(
                f"Controller.reach: got {self.reach!r}, expected a number, or one for each of "
                f"{len(self.muscles)} muscles"
            )
        if self.growth is not None:
            if (reach * self.growth.limit).min() <= -1.0:
                raise ValueError("Controller.reach: a rest length would shrink to nothing")
        elif np.abs(reach).max() >= 1.0 or (reach.ndim == 0 and reach <= 0.0):
            raise ValueError(
                f"Controller.reach: got {self.reach!r}, expected more than 0 and less than 1"
            )
        return float(reach) if reach.ndim == 0 else tuple(reach.tolist())

    def replace(self, **changes: Any) -> Controller:
        """The same controller with some fields replaced."""
        return replace(self, **changes)

    def aimed(self, place: ArrayLike, motion: ArrayLike) -> Controller:
        """The same with its goals and lights elsewhere, see `Robot.aimed`."""
        where = {"place": triple("place", place), "motion": triple("motion", motion)}
        sensors = [replace(s, **where) if s.kind in TARGETS else s for s in self.sensors]
        return replace(self, sensors=tuple(sensors))

    def checked(self, weights: ArrayLike, leading: tuple[int, ...] = ()) -> FloatArray:
        """Weights of this network, shape (*leading, n_weights), as a read-only float64 copy.

        Raises:
            ValueError: They are of another shape, or not finite.
        """
        array = np.array(weights, np.float64)
        expected = (*leading, self.n_weights)
        if array.shape != expected:
            raise ValueError(f"weights: shape {array.shape} given, {expected} expected")
        if not np.isfinite(array).all():
            raise ValueError("weights: a value is not finite")
        array.flags.writeable = False
        return array

    def check(self, masses: int, springs: int) -> None:
        """Refuse, with a ValueError, a controller that does not fit a body of so many of each."""
        for name, used, count in [
            ("spring", self.muscles, springs),
            *(
                (_over(sensor), sensor.of, springs if _over(sensor) == "spring" else masses)
                for sensor in self.sensors
            ),
        ]:
            for index in used:
                if not 0 <= index < count:
                    raise ValueError(f"controller: {name} {index} named, there are {count}")
        if self.frame is None or self.frame.shape != (3, masses):
            raise ValueError("controller: it is of another body; attach it by Robot.controlled")

    def renamed(self, masses: np.ndarray, springs: np.ndarray, n_masses: int) -> Controller:
        """The same in a body whose mass ``masses[i]`` and spring ``springs[i]`` were its i-th.

        Raises:
            ValueError: A spring that it uses is gone, ``springs[i]`` < 0.
        """
        new = {"mass": masses, "spring": springs}
        used = {*self.muscles, *(i for s in self.sensors if _over(s) == "spring" for i in s.of)}
        if any(springs[i] < 0 for i in used):
            raise ValueError("controller: a spring that it uses is merged away")
        frame = np.zeros((3, n_masses))
        np.add.at(frame.T, masses, self.frame.T)
        return replace(
            self,
            sensors=tuple(
                replace(s, of=tuple(int(new[_over(s)][i]) for i in s.of)) for s in self.sensors
            ),
            muscles=tuple(int(springs[i]) for i in self.muscles),
            frame=frame,
        )

    def _values(self) -> tuple:
        frame = None if self.frame is None else (self.frame + 0.0).tobytes()
        network = (self.hidden, self.recurrent, (self.weights + 0.0).tobytes())
        pace = (self.reach, self.rate, self.response, self.growth)
        return (self.sensors, self.muscles, self.outputs, *network, *pace, frame)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Controller) and self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())


def body_frame(masses: FloatArray, positions: FloatArray) -> FloatArray:
    """Parts of the masses in the centre of mass, in forward (x) and left (y), shape (3, M).

    With x_i of any deformed pose, the sum of part_i x_i is where the affine map that is nearest to
    the deformation, in the mean square over the mass, takes the unit vector of the axis.
    """
    parts = masses / masses.sum()
    arms = positions - parts @ positions
    spread = np.linalg.pinv((arms * parts[:, None]).T @ arms)
    return np.stack([parts, *(parts[:, None] * (arms @ spread)).T[:2]])


def _over(sensor: Sensor) -> str:
    return "spring" if sensor.kind == "length" else "mass"


def _outputs(given: Sequence) -> tuple:
    """Indices, or pairs of indices."""
    array = np.asarray(given)
    if array.ndim != 2:
        return _indices("outputs", given)
    if array.shape[1] != 2:
        raise ValueError(f"Controller.outputs: got {given!r}, expected one or two for each muscle")
    return tuple(zip(*(_indices("outputs", column) for column in array.T), strict=True))


def _indices(name: str, values: Sequence[int]) -> tuple[int, ...]:
    array = np.asarray(values)
    if array.dtype == bool:
        array = np.flatnonzero(array)
    good = array.ndim == 1 and len(array) and array.dtype.kind in "iu" and array.min() >= 0
    if not good:
        raise ValueError(f"Controller.{name}: got {values!r}, expected indices from 0 on")
    return tuple(int(i) for i in array)
