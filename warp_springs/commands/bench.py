"""``warp-springs bench``: springs per second on this machine, checked before they are printed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rich.console import Console

    from warp_springs.bench.measure import Row

__all__ = ["BenchCommand"]

SectionName = Literal["precision", "population", "robot", "features", "layout", "integrator"]


@dataclass(frozen=True)
class BenchCommand:
    """Measure springs per second on this machine, each row checked before its speed is printed.

    In each section one thing varies and the rest stays: 1,024 breathing cubes on the classroom's
    ground, with its friction and damping, symplectic Euler, dt = 0.1 ms, float32, all cores. A
    spring per second is one evaluation of one spring in one step.

    Every row first runs 150 steps, in which its robots land, and must agree with an independent
    NumPy program: every mass within 1e-10 m in float64, the typical mass within 1e-6 m otherwise.
    A row that does not shows its error and no speed, and the exit code is 1. The rows of a section
    are then timed in turns, so that they share whatever else the machine is doing, and the median
    is shown; compare rows of one section, and mistrust a busy machine. "First use" is the time to
    pack the robots and take one step: it compiles whatever is not in the cache yet.

    Beside every alternative (NumPy, Numba, JAX, Taichi, Newton, C++): benchmarks/peers/run.py.
    """

    section: tuple[SectionName, ...] = (
        "precision",
        "population",
        "robot",
        "features",
        "layout",
        "integrator",
    )
    """Which sections to measure."""
    sizes: tuple[int, ...] = (1, 16, 256, 1024, 8192)
    """Numbers of robots in the population section."""
    threads: int | None = None
    """CPU threads; by default as many as this process may use."""
    device: str = "cpu"
    """Where to run."""
    rounds: int = 5
    """How often each row is timed."""
    seconds: float = 0.3
    """How long, about, each time."""
    quick: bool = False
    """A check in under a minute: 64 robots, short rounds. Its speeds are rough."""
    json: Path = Path("out/bench.json")
    """File to write all rows to."""

    def run(self, console: Console) -> None:
        """Measure, print, write."""
        from warp_springs.bench.cases import SECTIONS, base_case, section
        from warp_springs.bench.machine import machine
        from warp_springs.bench.measure import measure
        from warp_springs.bench.report import as_json, show, write

        self._check()
        facts = machine(self.device)
        console.print(", ".join(f"{name} {value}" for name, value in facts.items()), markup=False)
        base = base_case(self.device, self.threads, self.quick)
        sizes = [size for size in self.sizes if size <= 64] or [1] if self.quick else self.sizes
        rounds, seconds = (2, 0.02) if self.quick else (self.rounds, self.seconds)
        every: list[Row] = []
        lines: list[dict] = []
        for name in self.section:
            with console.status(name) as status:
                rows = measure(section(name, base, sizes), rounds, seconds, status.update)
            show(console, SECTIONS[name][0], rows)
            lines += as_json(name, rows)
            every += rows
        write(self.json, facts, lines)
        _say_what_failed(console, every)
        console.print(f"\nwrote {self.json}", markup=False, soft_wrap=True)
        wrong = sum(bool(row.wrong) for row in every)
        if wrong:
            raise RuntimeError(f"{wrong} of {len(every)} rows are wrong")

    def _check(self) -> None:
        for name in ("rounds", "threads"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"--{name}: got {value}, expected 1 or more")
        if not self.seconds > 0.0:
            raise ValueError(f"--seconds: got {self.seconds}, expected more than 0")
        if not self.sizes or min(self.sizes) < 1:
            raise ValueError(f"--sizes: got {self.sizes}, expected numbers of 1 or more")


def _say_what_failed(console: Console, rows: list[Row]) -> None:
    from rich.markup import escape

    from warp_springs.bench.measure import describe

    for row in rows:
        if row.wrong:
            console.print(f"[bold red]wrong[/]: {escape(f'{describe(row.case)}: {row.wrong}')}")
        if row.missing:
            words = f"not here: {describe(row.case)}, {row.case.layout}: {row.missing}"
            console.print(escape(words))
