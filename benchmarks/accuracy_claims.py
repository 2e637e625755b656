"""The figures that the simulator is held to, each measured anew."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from accuracy_bodies import G, breathing_lattice, plate
from accuracy_measure import Row, cost_of, step_name
from accuracy_peer import Comparison
from accuracy_scenes import CASES

import warp_springs as ws

__all__ = ["SAVINGS", "Claim", "check"]

#: What is measured with: the steps that the plot recommends, and the classroom's step.
DEFAULTS = (("chin4", 1e-3), ("chin4", 5e-4), ("leapfrog", 1e-4))
#: Where the order is measured, and the largest steps that are small for that [s].
FREE_FLIGHT, SMALL = ("oscillator", "slinky", "free cube"), {"leapfrog": 1e-3, "chin4": 4e-3}
#: Scene, error [m], and how many times less it should cost than symplectic Euler in evaluations,
#: and than two kernels in seconds.
SAVINGS = (("bouncing cube", 1e-4, 10.0, 100.0), ("lattice", 1e-5, 20.0, 500.0))
#: Errors between which a slope is fitted [m]: above rounding, and small enough to be a power law.
POWER_LAW = (1e-12, 1e-4)


@dataclass(frozen=True)
class Claim:
    """Something that should hold.

    Attributes:
        about: What is measured.
        how: With which integrator, and with which step where there is one.
        measured: The figure.
        allowed: Its bounds, lowest and highest.
        unit: Its unit.
    """

    about: str
    how: str
    measured: float
    allowed: tuple[float, float]
    unit: str = ""

    @property
    def holds(self) -> bool:
        """Whether the figure is within its bounds."""
        return self.allowed[0] <= self.measured <= self.allowed[1]


def check(rows: Iterable[Row], comparisons: Iterable[Comparison]) -> Iterator[Claim]:
    """Every claim that can be judged from these rows, and those that need runs of their own."""
    series: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.series.precision == "float64" and row.series.substeps != "one":
            series.setdefault((row.scene, row.series.integrator), []).append(row)
    yield from _errors(series)
    yield from _slopes(series)
    yield from _savings(series, comparisons)
    for claim in (_energy, _ledger, _sliding, _sticking, _inverse_speed, _terminal_speed):
        for integrator, dt in DEFAULTS:
            about, measured, allowed, unit = claim({"dt": dt, "integrator": integrator})
            yield Claim(about, f"{integrator}, {step_name(dt)}", measured, allowed, unit)


# From the sweep.


def _errors(series: dict) -> Iterator[Claim]:
    for dt, limit in ((1e-3, 1.5e-3), (1e-4, 1.5e-5)):
        for integrator in ("chin4", "leapfrog"):
            for row in series.get(("bouncing cube", integrator), []):
                if row.dt == dt:
                    how = f"{integrator}, {step_name(dt)}"
                    yield Claim("bouncing cube, error", how, row.first_error, (0, limit), "m")


def _slopes(series: dict) -> Iterator[Claim]:
    for integrator, allowed in (("leapfrog", (1.9, 2.1)), ("chin4", (3.8, 4.2))):
        for scene in FREE_FLIGHT:
            rows = [
                row for row in series.get((scene, integrator), []) if row.dt <= SMALL[integrator]
            ]
            points = [(r.dt, r.error) for r in rows if POWER_LAW[0] < r.error < POWER_LAW[1]]
            if len(points) > 1:
                slope = float(np.polyfit(*np.log(np.transpose(points)), 1)[0])
                yield Claim(f"{scene}, order", integrator, slope, allowed)


def _savings(series: dict, comparisons: Iterable[Comparison]) -> Iterator[Claim]:
    for scene, target, least, _ in SAVINGS:
        for whose in ("first", "median"):
            costs = {}
            for name in ("chin4", "leapfrog", "euler"):
                rows = series.get((scene, name), [])
                if whose == "first":
                    rows = [replace(row, error=row.first_error) for row in rows]
                costs[name] = cost_of(rows, target) or math.inf
            best = min(("chin4", "leapfrog"), key=costs.get)
            if math.isfinite(costs["euler"]):
                about = f"{scene} to {target:g} m, evaluations saved"
                saved = costs["euler"] / costs[best]
                yield Claim(about, f"{best}, {whose} robot", saved, (least, math.inf), "x")
    for c in comparisons:
        least = next(least for scene, _, _, least in SAVINGS if c.scene.startswith(scene))
        about = f"{c.scene}, seconds saved"
        yield Claim(about, f"{c.ours}, {step_name(c.dt)}", c.ratio, (least, math.inf), "x")


# Runs of their own. Each gives what is measured, the figure, its bounds and its unit.

Figure = tuple[str, float, tuple[float, float], str]


def _energy(how: dict) -> Figure:
    case = CASES["bouncing cube"]
    energy = ws.Simulation(case.robot, case.scene, **how).run(10.0, fps=200, energy=True).energy
    worst = np.abs(energy.total[0] / energy.total[0, 0] - 1.0).max()
    return "bouncing cube, energy in 10 s", 100 * float(worst), (0.0, 0.1), "%"


def _ledger(how: dict) -> Figure:
    ground = ws.Ground(static_friction=0.6, kinetic_friction=0.5)
    scene = ws.Scene(ground=ground, damping=1.0, drag=0.01)
    energy = ws.Simulation(breathing_lattice(), scene, **how).run(4.0, fps=100, energy=True).energy
    exchanged = energy.losses[0, -1] + abs(energy.work[0, -1])
    part = float(np.abs(energy.residual[0]).max() / exchanged)
    return "ledger, residual, all on", 100 * part, (0.0, 0.1), "%"


def _sliding(how: dict) -> Figure:
    cube = ws.shapes.cube().moved((0.0, 0.0, -0.2 * G / 1e5)).moving((0.6, 0.8, 0.0))
    scene = ws.Scene(ground=ws.Ground(static_friction=0.4, kinetic_friction=0.3))
    result = ws.Simulation(cube, scene, **how).run(0.6)
    way = np.hypot(*(result.center_of_mass[0] - cube.center_of_mass)[:2])
    off = abs(float(way) * 2 * 0.3 * G - 1.0)
    return "sliding distance, error", 100 * off, (0.0, 0.5), "%"


def _sticking(how: dict) -> Figure:
    angle = math.atan(0.7)  # steep, yet below the static threshold of 1
    scene = ws.Scene(gravity=(G * math.sin(angle), 0.0, -G * math.cos(angle)))
    lying = plate()
    lift = 0.1 * G * (1.0 - math.cos(angle)) / 1e5  # a slope carries less of the weight
    body = lying.replace(velocities=np.zeros((4, 3))).moved((0.0, 0.0, lift))
    moved = np.abs(ws.Simulation(body, scene, **how).run(10.0).positions(0) - body.positions).max()
    return "stuck plate, way in 10 s", float(moved), (0.0, 1e-9), "m"


def _inverse_speed(how: dict) -> Figure:
    drag, mass = 0.05, 0.1
    cube = ws.shapes.cube(mass=8 * mass).moving((3.0, -4.0, 12.0))
    scene = ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None, drag=drag)
    simulation, worst = ws.Simulation(cube, scene, **how), 0.0
    for second in (1, 2, 3):
        speed = np.linalg.norm(simulation.run(1.0).velocities(0), axis=1)
        growth = (1.0 / speed - 1.0 / 13.0) / (drag / mass * second)
        worst = max(worst, float(np.abs(growth - 1.0).max()))
    return "1/v under drag, not straight", 100 * worst, (0.0, 0.1), "%"


def _terminal_speed(how: dict) -> Figure:
    drag, mass = 0.05, 0.1
    cube, scene = ws.shapes.cube(mass=8 * mass), ws.Scene(ground=None, drag=drag)
    velocity = ws.Simulation(cube, scene, **how).run(6.0).velocities(0)[:, 2]
    off = float(np.abs(-velocity / math.sqrt(mass * G / drag) - 1.0).max())
    return "terminal speed, error", 100 * off, (0.0, 0.1), "%"
