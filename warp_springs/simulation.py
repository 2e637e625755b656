"""Simulation: robots are packed once, then run in pieces of any length."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Literal

import numpy as np

from warp_springs.batch import Batch
from warp_springs.body.variants import Variants
from warp_springs.checks import check_choice, check_number
from warp_springs.energy import Energy
from warp_springs.engine.audit import Audit, flow_places
from warp_springs.engine.buffers import aligned
from warp_springs.engine.control import pilots
from warp_springs.engine.layouts import LAYOUTS, check_layout, choose, device_named
from warp_springs.engine.method import AUTO_DT, Method
from warp_springs.engine.slices import Tape, cut, run_all
from warp_springs.engine.worlds import Member, gathered, on_a_grid
from warp_springs.kernels.buffers import ACCOUNTS, ENERGIES, dtype_of
from warp_springs.kernels.law import EVALUATIONS
from warp_springs.kernels.obstacles import obstacle_tables
from warp_springs.result import Result
from warp_springs.robot import Robot
from warp_springs.scene import Scene
from warp_springs.stability import Limits

__all__ = ["Simulation"]


class Simulation:
    """N robots in one packed batch, each in a world of its own.

    Args:
        robots: A ``Robot``, a sequence of them, or ``Variants`` of one body.
        scene: The world, the same for all; ``Scene()`` by default.
        dt: Step [s]; or ``"auto"``, half a millisecond, halved for each robot until it is half of
            ``ws.stable_dt`` or less, so that one stiff robot does not slow a thousand.
        device: ``"cpu"``, or a GPU: ``"cuda:0"``.
        precision: ``"float64"``; ``"float32"`` for about twice the speed, near the origin of the
            world; or ``"mixed"``: forces in float32, positions and velocities held as sums of two
            float32, about an origin that follows the robot, anywhere.
        integrator: ``"chin4"`` (fourth order, three evaluations of the springs a step),
            ``"leapfrog"`` (second order, one), or ``"euler"`` (symplectic Euler, the classroom's
            method). With the first two, gravity and the ground are sub-cycled in the drifts.
        contact_substeps: Steps of the contact flow within a drift; by default chosen for each robot
            from the ground's stiffness, its lightest mass and the step.
        threads: CPU threads, by default as many as this process may use.
        limits: What stops a robot; ``Limits()`` by default.
        world: ``"apart"``: each robot in a world of its own. ``"grid"``: likewise, but side by
            side, for a joint picture. ``"together"``: all in one world, or the number of its
            world for each robot: the robots of one world become one robot, with one status and
            one ledger, and meet if the scene has collisions; ``members`` says which masses are
            whose.
        layout: How the robots lie in memory and which thread does what; the physics is the same,
            results agree to rounding. ``"auto"`` chooses for each robot: on a CPU ``"lanes"``
            (many robots at once, one in each SIMD lane), for a large body ``"flat"`` (its masses
            shared by all threads); on a GPU ``"block"`` (whole robots in a block of threads, up to
            320 masses, 384 in mixed precision, 512 in float32), for a larger body ``"flat"``. A CPU
            runs ``"block"`` too, slowly, to verify.

    Raises:
        ValueError: An argument is out of range, there is no robot, the machine has no such device,
            or a robot does not fit the layout.
        TypeError: ``robots``, ``scene`` or ``limits`` is something else.

    The first use of a combination of features compiles its kernels; they are cached on disk.
    """

    def __init__(
        self,
        robots: Robot | Sequence[Robot],
        scene: Scene | None = None,
        dt: float | Literal["auto"] = "auto",
        *,
        device: str = "cpu",
        precision: Literal["float64", "float32", "mixed"] = "float64",
        integrator: Literal["chin4", "leapfrog", "euler"] = "chin4",
        contact_substeps: int | None = None,
        threads: int | None = None,
        limits: Limits | None = None,
        world: Literal["apart", "grid", "together"] | Sequence[int] = "apart",
        layout: Literal["auto", "lanes", "block", "flat"] = "auto",
    ) -> None:
        self.robots = _check_robots(robots)
        self.members: tuple[tuple[Member, ...], ...] | None = None
        bodies = self._gather(world)
        self.scene = _check_type("scene", Scene() if scene is None else scene, Scene)
        self.limits = _check_type("limits", Limits() if limits is None else limits, Limits)
        auto = isinstance(dt, str)
        if auto:
            check_choice("dt", dt, ("auto",))
        else:
            check_number("dt", dt, above=0.0)
        check_choice("precision", precision, ("float64", "float32", "mixed"))
        check_choice("integrator", integrator, ("chin4", "leapfrog", "euler"))
        if contact_substeps is not None:
            _check_count("contact_substeps", contact_substeps)
            if integrator == "euler":
                raise ValueError("contact_substeps: 'euler' has none")
        if threads is not None:
            _check_count("threads", threads)
        check_choice("layout", layout, LAYOUTS)
        place = device_named(device)
        check_layout(layout, place, precision, [robot.n_masses for robot in _bodies(self.robots)])
        self.dt, self.device, self.layout = AUTO_DT if auto else float(dt), place.alias, layout
        self.precision, self.integrator = precision, integrator
        self.threads = threads or usable_cores()
        self._step = 0
        self._underway: tuple | None = None
        self._interrupted = False
        self._method = Method(self.dt, auto, integrator, precision, contact_substeps, self.limits)
        layout_of = functools.partial(choose, layout, place, precision)
        self._batch = Batch(self.robots, self.scene, self._method, layout_of, bodies)
        self._buffers = self._allocate()
        self._slices = cut(self._batch, self._buffers, self.threads, place)
        self._audits = [Audit(piece, self._batch, self.limits.gain) for piece in self._slices]
        constants = self._buffers["constants"]
        self._pilots = pilots(self._slices, self._batch, self.scene, constants, self.dt)

    def _gather(self, world: str | Sequence[int]) -> dict[int, np.ndarray]:
        """Put the robots into their worlds; the body of each mass of a world of several."""
        if isinstance(world, str):
            check_choice("world", world, ("apart", "grid", "together"))
            if world == "apart":
                return {}
            if world == "grid":
                self.robots = tuple(on_a_grid(self.robots))
                return {}
            world = [0] * len(self.robots)
        worlds, members = gathered(self.robots, world)
        self.robots, self.members = tuple(worlds), tuple(map(tuple, members))
        sizes = [[part.stop - part.start for _, part in inside] for inside in members]
        return {i: np.repeat(np.arange(len(n)), n) for i, n in enumerate(sizes)}

    @property
    def time(self) -> float:
        """Simulated time so far [s]."""
        return self._step * self.dt

    @property
    def contact_substeps(self) -> np.ndarray:
        """Contact sub-steps of each robot, shape (N,); 1 without a ground and for ``"euler"``."""
        return self._batch.substeps.copy()

    @property
    def robot_dt(self) -> np.ndarray:
        """The step that each robot takes [s], shape (N,): ``dt``, or less with ``dt="auto"``."""
        return self.dt / 2.0**self._batch.levels

    def run(
        self,
        duration: float,
        fps: float | None = None,
        record: Iterable[int] | None = None,
        energy: bool = False,
        progress: Callable[[float], None] | None = None,
    ) -> Result:
        """Step all robots for ``duration`` seconds; a second call continues where this one ends.

        Args:
            duration: Simulated time [s], rounded to whole steps.
            fps: Frames to record per simulated second, from the start on; each is taken at the
                step that is nearest. Neither frames nor the cutting of a run into several change
                the motion by a bit.
            record: Robots whose frames are kept; by default, with ``fps``, all.
            energy: Whether to compute energies at the frames (without ``fps``: at start and end),
                and to stop who gains energy from nowhere (``Status.ENERGY``). Frames, and where a
                run begins, decide when that is noticed.
            progress: Called now and then with the fraction that is done, 0 to 1.

        Raises:
            ValueError: ``duration`` or ``fps`` is not positive, or ``record`` is out of range or
                given without ``fps``.
            RuntimeError: An earlier run was interrupted.
        """
        check_number("duration", duration, above=0.0)
        steps = round(duration / self.dt)
        if steps < 1:
            raise ValueError(f"duration: got {duration!r}, expected a step ({self.dt} s) or more")
        recorded = self._check_record(record, fps)
        if self._interrupted:
            raise RuntimeError("this simulation was interrupted during a run; make a new one")
        first, last = self._step, self._step + steps
        frame_steps = self._frame_steps(first, last, fps, energy)
        self._buffers["ledgers"][:] = 0.0
        for piece in self._slices:
            piece.prepare(ledger=energy)
        for pilot in self._pilots:
            if pilot is not None:
                pilot.open(ledger=energy)
        for audit in self._audits:
            audit.open()
        tapes = [
            Tape(
                piece,
                self._batch.slots,
                recorded,
                frame_steps,
                energy,
                audit,
                self.dt,
                pilot,
                self._batch.wearing,
            )
            for piece, audit, pilot in zip(self._slices, self._audits, self._pilots, strict=True)
        ]

        started = time.perf_counter()
        self._underway = (first, recorded, tapes, started)
        try:
            run_all(tapes, first, last, self.threads, progress)
        except BaseException:
            self._interrupted = True
            raise
        finally:
            self._underway = None
        self._step = last
        return self._result(first, frame_steps, recorded, tapes, time.perf_counter() - started)

    def so_far(self) -> Result | None:
        """The frames that the run under way has recorded up to now, for whoever is watching it.

        To be called by ``progress``; ``None`` where there is no run, or no frame of every robot
        yet. Frames, times and energies are final; the state "at the end" is that of the moment,
        which no two robots need to share.
        """
        if self._underway is None:
            return None
        first, recorded, tapes, started = self._underway
        count = min(tape.taken for tape in tapes)
        if not count:
            return None
        steps = tapes[0].frame_steps[:count]
        short = [tape.cut_to(count) for tape in tapes]
        return self._result(first, steps, recorded, short, time.perf_counter() - started)

    def _allocate(self) -> dict[str, np.ndarray]:
        """Every buffer of the kernels by name: the packed ones, and what is written."""
        batch = self._batch
        obstacles, heights = obstacle_tables(self.scene)
        buffers = batch.arrays | {
            "bundles": batch.bundles.ravel(),
            "constants": self._method.constants(self.scene).ravel(),
            "obstacles": obstacles,
            "heights": heights,
        }
        for name in ("positions", "velocities", "low_positions", "low_velocities"):
            buffers[f"good_{name}"] = self._buffer(f"good_{name}", buffers[name])
        places, lanes = np.zeros(len(buffers["positions"])), len(buffers["omegas"])
        sizes = {"seen_centers": 3, "seen_energies": ENERGIES, "ledgers": 2 * len(ACCOUNTS)}
        sizes |= dict.fromkeys(("seen_states", "state_times", "seen_state_times"), 1)
        for name in ("seen_positions", "seen_velocities"):
            buffers[name] = self._buffer(name, places)
        for name, columns in sizes.items():
            buffers[name] = self._buffer(name, np.zeros(columns * lanes))
        return buffers

    def _buffer(self, name: str, values: np.ndarray) -> np.ndarray:
        """A buffer of the kernels that begins with these values."""
        dtype = dtype_of(name, self.precision)
        return aligned([values.astype(dtype, copy=False)], dtype)

    def _check_record(self, record: Iterable[int] | None, fps: float | None) -> np.ndarray:
        count = len(self.robots)
        if fps is None:
            if record is not None:
                raise ValueError("record: frames are taken at a rate; give fps as well")
            return np.zeros(0, np.int64)
        check_number("fps", fps, above=0.0)
        robots = list(range(count) if record is None else record)
        for robot in robots:
            if not isinstance(robot, (int, np.integer)) or not -count <= robot < count:
                raise ValueError(f"record: got {robot!r}, expected indices of {count} robots")
        return np.unique(np.asarray(robots, np.int64) % count)

    def _frame_steps(self, first: int, last: int, fps: float | None, energy: bool) -> list[int]:
        """Steps at which frames are taken: a frame every 1 / fps seconds, from the start on."""
        if fps is None:
            return [first, last] if energy else []
        count = int((last - first) * self.dt * fps + 1e-6) + 1
        steps = first + np.rint(np.arange(count) / (fps * self.dt)).astype(np.int64)
        return np.minimum(steps, last).tolist()

    def _worn(self) -> dict[int, np.ndarray]:
        """When springs broke [s] and how far they flowed [m], (2, S), where they have limits."""
        worn, broken = self._buffers["worn"], self._buffers["broken_at"]
        found = {}
        for robot, (place, lane) in self._batch.wearing.items():
            found[robot] = np.stack([broken[place], worn[flow_places(place, lane)]])
        return found

    def _result(self, first, frame_steps, recorded, tapes, wall_time: float) -> Result:
        slots, buffers = self._batch.slots, self._buffers
        lanes = slots.lane_indices(slice(None), 1)[:, 0]
        centers = slots.lane_indices(slice(None), 3)
        status = buffers["seen_states"][lanes].astype(np.int64)
        stopped_at = buffers["seen_state_times"][lanes]
        # Steps before a robot was stopped count; each is of the robot's own size.
        until = np.where(status == 0, self.time, np.clip(stopped_at, first * self.dt, self.time))
        steps = np.rint((until - first * self.dt) / self.robot_dt).astype(np.int64)
        times = np.array(frame_steps, np.float64) * self.dt
        return Result(
            robots=self.robots,
            scene=self.scene,
            dt=self.dt,
            precision=self.precision,
            integrator=self.integrator,
            device=self.device,
            start_time=first * self.dt,
            end_time=self.time,
            steps=self._step - first,
            status=status,
            status_time=np.where(status == 0, np.nan, stopped_at),
            center_of_mass=buffers["seen_centers"][centers].astype(np.float64),
            times=times,
            recorded=tuple(recorded.tolist()),
            energy=_energy(tapes, len(self.robots)),
            spring_evaluations=int((slots.springs * steps).sum()) * EVALUATIONS[self.integrator],
            wall_time=wall_time,
            _slots=slots.copy(),  # robots may move later
            _worn=self._worn(),
            _signals={i: s for p in self._pilots if p is not None for i, s in p.signals().items()},
            _positions=buffers["seen_positions"].copy(),
            _velocities=buffers["seen_velocities"].copy(),
            _frames={i: f for tape in tapes for i, f in tape.frames_by_robot().items()},
            _heard={i: s for tape in tapes for i, s in tape.signals.by_robot().items()},
            _flowed={i: y for tape in tapes for i, y in tape.flowed.by_robot().items()},
        )


def _energy(tapes: Sequence[Tape], robots: int) -> Energy | None:
    """Energies of all robots, collected from the slices."""
    if not tapes[0].energy:
        return None
    table = np.zeros((ENERGIES, robots, len(tapes[0].frame_steps)))
    for tape in tapes:
        table[:, tape.members] = tape.energies.transpose(2, 1, 0)
    table[4:] -= table[4:, :, :1]  # the accounts are opened with the first frame
    return Energy(*table)


def _check_robots(robots: Robot | Sequence[Robot]) -> Sequence[Robot]:
    if isinstance(robots, Robot):
        return (robots,)
    if not isinstance(robots, Sequence):
        raise TypeError(f"robots: got {type(robots).__name__}, expected Robots")
    if len(robots) == 0:
        raise ValueError("robots: got none, expected at least one Robot")
    if isinstance(robots, Variants):
        return robots
    for index, robot in enumerate(robots):
        if not isinstance(robot, Robot):
            raise TypeError(f"robots[{index}]: got {type(robot).__name__}, expected a Robot")
    return tuple(robots)


def _bodies(robots: Sequence[Robot]) -> Sequence[Robot]:
    """The robots, or the one whose shape all of them have."""
    return [robots.body] if isinstance(robots, Variants) else robots


def _check_type(name: str, value: object, kind: type):
    if not isinstance(value, kind):
        raise TypeError(f"{name}: got {type(value).__name__}, expected a {kind.__name__}")
    return value


def _check_count(name: str, value: int) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise ValueError(f"{name}: got {value!r}, expected an integer of 1 or more")


def usable_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
