"""The figures that the simulator is held to, each measured anew."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from accuracy_measure import Row, Series, cost_of
from accuracy_peer import Comparison
from accuracy_scenes import CASES, G, breathing_lattice, plate

import warp_springs as ws

__all__ = ["Claim", "check"]

#: What is measured with: the steps that the plot recommends, and the classroom's step.
DEFAULTS = (("chin4", 1e-3), ("chin4", 5e-4), ("leapfrog", 1e-4))
#: Errors between which a slope is fitted [m]: above rounding, and small enough to be a power law.
POWER_LAW = (1e-12, 1e-4)


@dataclass(frozen=True)
class Claim:
    """Something that should hold.

    Attributes:
        about: What is measured, with which integrator and step.
        measured: The figure.
        allowed: Its bounds, lowest and highest.
        unit: Its unit.
    """

    about: str
    measured: float
    allowed: tuple[float, float]
    unit: str = ""

    @property
    def holds(self) -> bool:
        """Whether the figure is within its bounds."""
        return self.allowed[0] <= self.measured <= self.allowed[1]


def check(rows: Iterable[Row], comparisons: Iterable[Comparison]) -> Iterator[Claim]:
    """Every claim that can be judged from these rows, and those that need runs of their own."""
    series: dict[tuple[str, Series], list[Row]] = {}
    for row in rows:
        if row.series.precision == "float64" and row.series.substeps != "one":
            series.setdefault((row.scene, row.series.integrator), []).append(row)
    yield from _errors(series)
    yield from _slopes(series)
    yield from _savings(series, comparisons)
    for integrator, dt in DEFAULTS:
        how = {"dt": dt, "integrator": integrator}
        for claim in (_energy, _ledger, _sliding, _sticking, _inverse_speed, _terminal_speed):
            yield claim(f"{integrator} at dt = {dt:g} s", how)


# From the sweep.


def _errors(series: dict) -> Iterator[Claim]:
    for dt, limit in ((1e-3, 1.5e-3), (1e-4, 1.5e-5)):
        for integrator in ("chin4", "leapfrog"):
            for row in series.get(("bouncing cube", integrator), []):
                if row.dt == dt:
                    about = f"error of the bouncing cube, {integrator} at dt = {dt:g} s"
                    yield Claim(about, row.first_error, (0.0, limit), "m")


def _slopes(series: dict) -> Iterator[Claim]:
    for integrator, allowed in (("leapfrog", (1.9, 2.1)), ("chin4", (3.8, 4.2))):
        for scene in ("oscillator", "slinky", "free cube"):
            rows = series.get((scene, integrator), [])
            points = [(r.dt, r.error) for r in rows if POWER_LAW[0] < r.error < POWER_LAW[1]]
            if scene == "free cube":  # its oscillation has to be resolved
                points = [
                    (dt, error) for dt, error in points if dt <= 1e-3 or integrator == "chin4"
                ]
            if len(points) > 1:
                slope = np.polyfit(*np.log(np.transpose(points)), 1)[0]
                yield Claim(f"order in free flight, {scene}, {integrator}", float(slope), allowed)


def _savings(series: dict, comparisons: Iterable[Comparison]) -> Iterator[Claim]:
    for scene, target, least in (("bouncing cube", 1e-4, 10.0), ("lattice", 1e-5, 20.0)):
        euler = cost_of(series.get((scene, "euler"), []), target)
        for integrator in ("chin4", "leapfrog"):
            own = cost_of(series.get((scene, integrator), []), target)
            if own and euler:
                about = (
                    f"evaluations that euler needs for {target:g} m, {scene}, over {integrator}'s"
                )
                yield Claim(about, euler / own, (least, math.inf), "x")
    for c in comparisons:
        least = 100.0 if c.scene == "bouncing cube" else 500.0
        about = f"seconds that two kernels need for {c.target:g} m, {c.scene}, over {c.ours}'s"
        yield Claim(about, c.ratio, (least, math.inf), "x")


# Runs of their own.


def _energy(how_words: str, how: dict) -> Claim:
    case = CASES["bouncing cube"]
    total = (
        ws.Simulation(case.robot, case.scene, **how).run(10.0, fps=200, energy=True).energy.total
    )
    worst = np.abs(total[0] / total[0, 0] - 1.0).max()
    about = f"change of a bouncing cube's energy within 10 s, {how_words}"
    return Claim(about, 100 * float(worst), (0.0, 0.1), "%")


def _ledger(how_words: str, how: dict) -> Claim:
    ground = ws.Ground(static_friction=0.6, kinetic_friction=0.5)
    scene = ws.Scene(ground=ground, damping=1.0, drag=0.01)
    energy = ws.Simulation(breathing_lattice(), scene, **how).run(4.0, fps=100, energy=True).energy
    exchanged = energy.losses[0, -1] + abs(energy.work[0, -1])
    about = f"residual of the ledger, of the energy exchanged, everything on, {how_words}"
    return Claim(about, 100 * float(np.abs(energy.residual[0]).max() / exchanged), (0.0, 0.1), "%")


def _sliding(how_words: str, how: dict) -> Claim:
    cube = ws.shapes.cube().moved((0.0, 0.0, -0.2 * G / 1e5)).moving((0.6, 0.8, 0.0))
    scene = ws.Scene(ground=ws.Ground(static_friction=0.4, kinetic_friction=0.3))
    result = ws.Simulation(cube, scene, **how).run(0.6)
    way = np.hypot(*(result.center_of_mass[0] - cube.center_of_mass)[:2])
    about = f"error of a cube's sliding distance, {how_words}"
    return Claim(about, 100 * abs(float(way) * 2 * 0.3 * G - 1.0), (0.0, 0.5), "%")


def _sticking(how_words: str, how: dict) -> Claim:
    angle = math.atan(0.7)  # steep, yet below the static threshold of 1
    scene = ws.Scene(gravity=(G * math.sin(angle), 0.0, -G * math.cos(angle)))
    body = plate()
    body = body.replace(velocities=0.0 * body.velocities)
    body = body.moved((0.0, 0.0, 0.1 * G * (1.0 - math.cos(angle)) / 1e5))
    result = ws.Simulation(body, scene, **how).run(10.0)
    moved = np.abs(result.positions(0) - body.positions).max()
    return Claim(f"way of a stuck plate in 10 s, {how_words}", float(moved), (0.0, 1e-9), "m")


def _inverse_speed(how_words: str, how: dict) -> Claim:
    drag, mass = 0.05, 0.1
    cube = ws.shapes.cube(mass=8 * mass).moving((3.0, -4.0, 12.0))
    scene = ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None, drag=drag)
    simulation, worst = ws.Simulation(cube, scene, **how), 0.0
    for second in (1, 2, 3):
        speed = np.linalg.norm(simulation.run(1.0).velocities(0), axis=1)
        worst = max(worst, np.abs((1.0 / speed - 1.0 / 13.0) / (drag / mass * second) - 1.0).max())
    return Claim(f"departure of 1/v from a line, {how_words}", 100 * float(worst), (0.0, 0.1), "%")


def _terminal_speed(how_words: str, how: dict) -> Claim:
    drag, mass = 0.05, 0.1
    cube, scene = ws.shapes.cube(mass=8 * mass), ws.Scene(ground=None, drag=drag)
    velocity = ws.Simulation(cube, scene, **how).run(6.0).velocities(0)[:, 2]
    off = np.abs(-velocity / math.sqrt(mass * G / drag) - 1.0).max()
    return Claim(f"error of the terminal speed, {how_words}", 100 * float(off), (0.0, 0.1), "%")
