"""Which cases ``warp-springs bench`` measures: in each section one thing varies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args, get_type_hints

from warp_springs.bench.populations import ALL_FEATURES, FEATURES
from warp_springs.simulation import Simulation, usable_cores

__all__ = ["SECTIONS", "Case", "base_case", "choices", "section"]


def choices(argument: str) -> tuple[str, ...]:
    """What ``Simulation`` accepts for an argument; nothing if it has no such argument."""
    return get_args(get_type_hints(Simulation.__init__).get(argument))


@dataclass(frozen=True)
class Case:
    """One row: a population, its world, and how it is stepped.

    Attributes:
        robots: Number of robots.
        body: Their body, a name of ``populations.BODIES``.
        alike: Whether all share one topology; else none does.
        features: What scene and robots have.
        integrator: As ``Simulation`` takes it.
        precision: As ``Simulation`` takes it.
        layout: As ``Simulation`` takes it; ``"auto"`` leaves the choice to it.
        threads: CPU threads.
        device: ``"cpu"`` or a CUDA device.
    """

    robots: int = 1024
    body: str = "cube"
    alike: bool = True
    features: tuple[str, ...] = ALL_FEATURES
    integrator: str = "euler"
    precision: str = "float32"
    layout: str = "auto"
    threads: int = 1
    device: str = "cpu"


def section(name: str, base: Case, sizes: Sequence[int]) -> list[Case]:
    """The cases of a section around a base; ``sizes`` are the populations to try."""
    return SECTIONS[name][1](base, sizes)


def _precision(base: Case, sizes: Sequence[int]) -> list[Case]:
    return [
        replace(base, body=body, precision=precision, threads=threads)
        for body in ("cube", "lattice")
        for precision in choices("precision")
        for threads in sorted({1, base.threads})
    ]


def _population(base: Case, sizes: Sequence[int]) -> list[Case]:
    return [replace(base, robots=robots) for robots in sizes]


def _robot_size(base: Case, sizes: Sequence[int]) -> list[Case]:
    counts = {"cube": base.robots, "lattice": base.robots // 4, "block": base.robots // 16}
    return [replace(base, body=body, robots=max(1, n)) for body, n in counts.items()]


def _features(base: Case, sizes: Sequence[int]) -> list[Case]:
    sets = [(), *((feature,) for feature in FEATURES if feature != "friction")]
    sets += [("ground", "friction"), ALL_FEATURES]
    return [replace(base, features=features) for features in sets]


def _layout(base: Case, sizes: Sequence[int]) -> list[Case]:
    named = [layout for layout in choices("layout") if layout != "auto"]
    base = replace(base, body="lattice", robots=max(1, base.robots // 4))
    cases = [replace(base, layout=layout) for layout in named or ["auto"]]
    return [*cases, replace(base, alike=False)]


def _integrator(base: Case, sizes: Sequence[int]) -> list[Case]:
    return [replace(base, integrator=name) for name in choices("integrator")]


#: Name -> what varies, and the function that lists the cases.
SECTIONS = {
    "precision": ("precision, body and threads", _precision),
    "population": ("number of robots", _population),
    "robot": ("size of a robot", _robot_size),
    "features": ("what the scene has", _features),
    "layout": ("layout: robots of one topology, and each of its own", _layout),
    "integrator": ("integrator", _integrator),
}


def base_case(device: str, threads: int | None, quick: bool) -> Case:
    """The case around which everything varies: the classroom's scene, 1,024 cubes, float32."""
    return Case(robots=64 if quick else 1024, threads=threads or usable_cores(), device=device)
