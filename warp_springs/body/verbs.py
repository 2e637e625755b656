"""The verbs that give a robot its elements: cables, harmonics, pushes, constraints, and more."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.bonds import Bonds
from warp_springs.body.control import Controller, body_frame
from warp_springs.body.elements import (
    PER_SPRING,
    Elements,
    Push,
    Tether,
    Timetable,
    check_rows,
    frozen,
    spread,
)
from warp_springs.body.fields import require_vector
from warp_springs.body.waveform import Waveform
from warp_springs.checks import check_number

if TYPE_CHECKING:
    from warp_springs.robot import Robot

__all__ = ["Verbs"]

Chosen = ArrayLike | None
"""Indices, or a mask with one bool for each; None: all."""


class Verbs:
    """Verbs of a robot; each returns a new robot.

    ``springs`` and ``masses`` choose: indices, one index, or a mask of bools; all when left out.
    """

    __slots__ = ()

    # -- springs ------------------------------------------------------------------------------

    def breathing(
        self, amplitude: ArrayLike, omega: float, phase: ArrayLike = 0.0, springs: Chosen = None
    ) -> Robot:
        """Muscles: L0(t) = rest_length (1 + amplitude sin(omega t + phase)), omega in rad/s."""
        rows = self._chosen("springs", springs)
        changed = {"amplitude": self.amplitude.copy(), "phase": self.phase.copy()}
        changed["amplitude"][rows] = np.asarray(amplitude) * self.rest_length[rows]
        changed["phase"][rows] = phase
        return self.replace(omega=omega, **changed)

    def with_harmonics(
        self, amplitudes: ArrayLike, phases: ArrayLike = 0.0, springs: Chosen = None
    ) -> Robot:
        """Harmonics 2, 3, ... on top of the sine of the rest length.

        Args:
            amplitudes: Amplitude of each [m], shape (H,) or (n, H) for n springs.
            phases: Phase of each [rad], the same shape or one number.
            springs: Which springs.
        """
        amplitudes = np.asarray(amplitudes, np.float64)
        if amplitudes.ndim not in (1, 2):
            raise ValueError(f"amplitudes: shape {amplitudes.shape} given, (H,) or (n, H) expected")
        table = np.stack(np.broadcast_arrays(amplitudes, np.asarray(phases, np.float64)), axis=-1)
        return self._with_rows("harmonics", table, springs)

    def with_waveform(
        self,
        wave: Waveform | ArrayLike | Callable,
        omega: float,
        springs: Chosen = None,
        *,
        relative: bool = True,
        harmonics: int = 8,
    ) -> Robot:
        """Any periodic course of the rest length: L0(t) = rest_length (1 + wave(omega t)).

        Args:
            wave: A `ws.Waveform`, or what `ws.Waveform.fit` takes: a table over one period or a
                function of x = omega t. ``Waveform.fit(wave).error`` is the error of this.
            omega: [rad/s].
            springs: Which springs.
            relative: Whether the wave is a part of the rest length; else it is in metres and
                added to it.
            harmonics: How many harmonics a wave that is none yet gets.
        """
        fitted = wave if isinstance(wave, Waveform) else Waveform.fit(wave, harmonics)
        rows = self._chosen("springs", springs)
        unit = self.rest_length[rows] if relative else np.ones(len(rows))
        names = ("rest_length", "amplitude", "phase")
        changed = {name: getattr(self, name).copy() for name in names}
        changed["rest_length"][rows] += unit * fitted.mean
        changed["amplitude"][rows] = unit * fitted.amplitudes[0]
        changed["phase"][rows] = fitted.phases[0]
        robot = self.replace(omega=omega, **changed)
        if len(fitted.amplitudes) == 1:
            return robot
        return robot.with_harmonics(unit[:, None] * fitted.amplitudes[1:], fitted.phases[1:], rows)

    def with_omegas(self, omegas: ArrayLike, springs: Chosen = None) -> Robot:
        """Springs with an angular frequency of their own [rad/s], one number or one a spring."""
        return self._with_rows("omegas", omegas, springs)

    def with_cables(self, springs: Chosen = None) -> Robot:
        """Cables: full stiffness when longer than the rest length, none when shorter."""
        return self.with_curve([0.0], [0.0, 1.0], springs)

    def with_curve(self, stretch: ArrayLike, stiffness: ArrayLike, springs: Chosen = None) -> Robot:
        """Springs whose stiffness depends on the stretch s = L - L0, piecewise.

        The tension is k times the integral of ``stiffness`` from 0 to s: continuous, zero at the
        rest length.

        Args:
            stretch: Stretches at which the stiffness changes [m], increasing, shape (J,).
            stiffness: Stiffness below the first, between them and above the last, as parts of
                the spring's own, not negative, shape (J + 1,).
            springs: Which springs.
        """
        at, parts = np.asarray(stretch, np.float64), np.asarray(stiffness, np.float64)
        if at.ndim != 1 or len(at) == 0 or not np.isfinite(at).all() or (np.diff(at) <= 0).any():
            raise ValueError(f"stretch: got {stretch!r}, expected increasing numbers [m]")
        if parts.shape != (len(at) + 1,) or not (np.isfinite(parts) & (parts >= 0)).all():
            raise ValueError(f"stiffness: got {stiffness!r}, expected {len(at) + 1} parts >= 0")
        hinges = np.stack([at, np.diff(parts)], axis=-1)
        return self._with_rows("slope", parts[0], springs)._with_rows("hinges", hinges, springs)

    def with_hardening(self, cubic: ArrayLike, springs: Chosen = None) -> Robot:
        """Springs with a tension k s + k3 s^3 at a stretch s; ``cubic`` is k3 >= 0 [N/m^3]."""
        return self._with_rows("cubic", cubic, springs)

    def with_dashpots(self, ratio: ArrayLike, springs: Chosen = None) -> Robot:
        """A dashpot beside each spring; ``ratio`` of critical damping, 1 for the fastest return.

        Critical for the two masses alone, 2 sqrt(k m) with 1/m = 1/m_i + 1/m_j.
        """
        return self._with_rows("dashpot", ratio, springs)

    def with_limits(
        self,
        breaks: ArrayLike | None = None,
        yields: ArrayLike | None = None,
        springs: Chosen = None,
        *,
        area: ArrayLike = 1.0,
    ) -> Robot:
        """Springs that break, or yield, at a force [N] in tension or compression.

        Args:
            breaks: From this force on a spring is gone; never when left out.
            yields: Beyond this force a spring flows, and keeps a new rest length; never when
                left out.
            springs: Which springs.
            area: Cross-section [m^2]: with it the two are stresses [Pa].
        """
        robot = self
        for name, value in (("breaks", breaks), ("yields", yields)):
            if value is not None:
                robot = robot._with_rows(name, np.asarray(value) * np.asarray(area), springs)
        return robot

    def with_stiffness_in_time(
        self, times: ArrayLike, factors: ArrayLike, springs: Chosen = None, *, period: float = 0.0
    ) -> Robot:
        """Stiffness that changes in time: k times a factor, linear between the times.

        Args:
            times: Increasing times [s], shape (T,), two or more; constant before and after.
            factors: Not negative, shape (T,) or (n, T) for n springs.
            springs: Which springs.
            period: After so many seconds the table begins again; 0: never.
        """
        return self._with_timetable("factors", times, factors, springs, period)

    def with_winch(
        self, times: ArrayLike, offsets: ArrayLike, springs: Chosen = None, *, period: float = 0.0
    ) -> Robot:
        """Rest lengths that are wound in or out: L0 plus an offset [m], linear between the times.

        Arguments as of `with_stiffness_in_time`. A winch that only pulls is a cable too.
        """
        return self._with_timetable("offsets", times, offsets, springs, period)

    def controlled(self, controller: Controller) -> Robot:
        """The robot with a closed loop: sensors, a network and the muscles that it drives.

        Forward, left and up of the sensors are x, y and z of the robot as it is now; they turn with
        it. A robot may have several controllers, for different muscles. Variants of it may differ
        in ``weights`` (N, n_weights) if it has one.

        Raises:
            ValueError: The controller names masses or springs that the robot has not, or muscles
                that another one drives.
            TypeError: It is no `ws.Controller`.
        """
        if not isinstance(controller, Controller):
            kind = type(controller).__name__
            raise TypeError(f"controller: got {kind}, expected a Controller")
        others = self.elements.controllers
        taken = {i for other in others for i in other.muscles} & set(controller.muscles)
        if taken:
            raise ValueError(f"muscles: another controller drives spring {min(taken)}")
        attached = controller.replace(frame=body_frame(self.masses, self.positions))
        return self._with_elements(controllers=(*others, attached))

    def aimed(self, place: ArrayLike, motion: ArrayLike = (0.0, 0.0, 0.0)) -> Robot:
        """The robot with every goal and light that its controllers sense at a place (3,) [m].

        The place moves with ``motion`` (3,) [m/s].
        """
        controllers = self.elements.controllers
        return self._with_elements(controllers=tuple(c.aimed(place, motion) for c in controllers))

    # -- forces and constraints ---------------------------------------------------------------

    def pushed(
        self, masses: Chosen, force: ArrayLike, start: float = 0.0, duration: float = math.inf
    ) -> Robot:
        """A force [N], shape (3,), on each of some masses from ``start`` for a ``duration`` [s]."""
        rows = tuple(self._chosen("masses", masses).tolist())
        check_number("start", start, at_least=0.0)
        if not duration > 0.0:
            raise ValueError(f"duration: got {duration!r}, expected more than 0 s")
        vector = tuple(require_vector("force", force).tolist())
        push = Push(rows, vector, float(start), float(start + duration))
        return self._with_elements(pushes=(*self.elements.pushes, push))

    def tethered(
        self,
        masses: Chosen,
        stiffness: float,
        point: ArrayLike | None = None,
        rest_length: float = 0.0,
        start: float = 0.0,
        end: float = math.inf,
    ) -> Robot:
        """A soft constraint: springs between masses and a point, from ``start`` to ``end`` [s].

        Args:
            masses: Which masses; each has its own spring.
            stiffness: [N/m].
            point: [m], shape (3,); where each mass is now when left out.
            rest_length: [m].
            start: When they appear [s].
            end: When they vanish [s].
        """
        check_number("stiffness", stiffness, above=0.0)
        check_number("rest_length", rest_length, at_least=0.0)
        check_number("start", start, at_least=0.0)
        if not end > start:
            raise ValueError(f"end: got {end!r}, expected more than start = {start} s")
        new = []
        for mass in self._chosen("masses", masses).tolist():
            at = self.positions[mass] if point is None else require_vector("point", point)
            values = (float(stiffness), float(rest_length), float(start), float(end))
            new.append(Tether(mass, tuple(at.tolist()), *values))
        return self._with_elements(tethers=(*self.elements.tethers, *new))

    def fixed(self, masses: Chosen = None, axes: str = "xyz") -> Robot:
        """Masses that keep their coordinates along some axes, exactly: ``axes="x"`` is v_x = 0."""
        if not axes or set(axes) - set("xyz"):
            raise ValueError(f"axes: got {axes!r}, expected letters of 'xyz'")
        free = np.array([axis not in axes for axis in "xyz"], np.float64)
        rows = self._chosen("masses", masses)
        return self._bound(Bonds.to_axes(free, rows, self.positions))

    def held_to(self, shape: Any, masses: Chosen = None) -> Robot:
        """Masses held to a `ws.Plane`, `ws.Line`, `ws.Circle` or `ws.Sphere`, exactly, without
        friction. They are put on it, at the nearest point, and their velocities along it.

        The shape moves and turns with the robot afterwards.
        """
        return self._bound(Bonds.to_shape(shape, self._chosen("masses", masses)))

    def shod(
        self,
        masses: Chosen = None,
        *,
        static_friction: float | None = None,
        kinetic_friction: float | None = None,
        stiffness: float | None = None,
    ) -> Robot:
        """Masses with a skin of their own: its friction and stiffness [N/m] hold on every surface.

        What is left out stays the surface's own: feet of rubber, a belly of Teflon.
        """
        rows = self._chosen("masses", masses)
        contact = np.array(spread(self.elements, "contact", self.n_masses))
        given = (static_friction, kinetic_friction, stiffness)
        names = ("static_friction", "kinetic_friction", "stiffness")
        for column, (name, value) in enumerate(zip(names, given, strict=True)):
            if value is not None:
                bound = {"above": 0.0} if name == "stiffness" else {"at_least": 0.0}
                check_number(name, value, **bound)
                contact[rows, column] = value
        return self._with_elements(contact=frozen(contact))

    # -- how ----------------------------------------------------------------------------------

    def _chosen(self, what: str, which: Chosen) -> np.ndarray:
        """Indices of chosen springs or masses, or a ValueError."""
        count = self.n_springs if what == "springs" else self.n_masses
        if which is None:
            return np.arange(count)
        rows = np.atleast_1d(np.asarray(which))
        if rows.dtype == bool and rows.shape == (count,):
            return np.flatnonzero(rows)
        if rows.size == 0:
            return np.zeros(0, np.int64)
        if rows.dtype.kind not in "iu" or rows.ndim != 1:
            raise ValueError(f"{what}: got {which!r}, expected indices or {count} bools")
        if rows.min() < -count or rows.max() >= count:
            raise ValueError(f"{what}: got {which!r}, expected indices of {count} {what}")
        return rows.astype(np.int64) % count

    def _with_elements(self, **changes: Any) -> Robot:
        return self.replace(elements=self.elements.replace(**changes))

    def _with_rows(self, name: str, values: ArrayLike, springs: Chosen) -> Robot:
        """The robot with rows of an element's array set, others neutral or as they were."""
        rows = self._chosen("springs", springs)
        values = np.asarray(values, np.float64)
        sizes = PER_SPRING[name][0]
        width = values.shape[-2] if sizes else 0
        table = np.array(spread(self.elements, name, self.n_springs, {name: width}))
        if sizes and table.shape[1] < width:
            table = np.pad(table, ((0, 0), (0, width - table.shape[1]), (0, 0)))
        try:
            if sizes:
                table[rows] = 0.0
                table[rows, :width] = values
            else:
                table[rows] = values
        except ValueError:
            raise ValueError(
                f"{name}: shape {values.shape} given for {len(rows)} springs"
            ) from None
        check_rows(name, table, self.n_springs)
        return self._with_elements(**{name: frozen(table)})

    def _with_timetable(self, column, times, values, springs, period) -> Robot:
        rows = self._chosen("springs", springs)
        times, values = np.asarray(times, np.float64), np.asarray(values, np.float64)
        if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0).all():
            raise ValueError(f"times: shape {times.shape} given, two or more, increasing, expected")
        if values.shape not in ((len(times),), (len(rows), len(times))):
            raise ValueError(
                f"{column}: shape {values.shape} given, ({len(times)},) or "
                f"({len(rows)}, {len(times)}) expected"
            )
        if not np.isfinite(values).all() or (column == "factors" and values.min() < 0.0):
            raise ValueError(f"{column}: a value is not finite, or a factor is negative")
        check_number("period", period, at_least=0.0)
        if period and (times[0] < 0.0 or times[-1] > period):
            raise ValueError(f"times: must lie between 0 and the period, {period} s")
        old = self.elements.timetable
        if old is not None and old.period != period:
            raise ValueError(f"period: got {period}, the robot's timetable has {old.period} s")
        every = times if old is None else np.unique(np.concatenate([times, old.times]))
        tables = {"factors": np.ones((self.n_springs, len(every)))}
        tables["offsets"] = np.zeros_like(tables["factors"])
        if old is not None:
            tables["factors"], tables["offsets"] = (np.array(part.T) for part in old.at(every))
        flat = np.broadcast_to(values, (len(rows), len(times)))
        courses = [np.interp(every, times, row) for row in flat]
        tables[column][rows] = np.reshape(courses, (len(rows), len(every)))
        table = Timetable(frozen(every), *map(frozen, tables.values()), float(period))
        return self._with_elements(timetable=table)

    def _bound(self, bonds: Bonds) -> Robot:
        bonds = self.elements.bonds.joined(bonds)
        positions, velocities = bonds.put(self.positions, self.velocities)
        elements: Elements = self.elements.replace(bonds=bonds)
        return self.replace(elements=elements, positions=positions, velocities=velocities)
