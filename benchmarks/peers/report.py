"""What was measured, as tables in the terminal and as JSON."""

import json
import platform
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from peers.fleet import Fleet, cores
from peers.measure import ALLOWED, FEATURES, Row
from warp_springs.bench.machine import processor

__all__ = ["as_json", "say_targets", "tables", "write"]

OURS = "warp_springs"


def tables(console: Console, title: str, rows: list[Row]) -> None:
    """One table: a line for each program, its rates on one core and on all."""
    names = list(dict.fromkeys(row.program.name for row in rows))
    counts = sorted({row.program.threads for row in rows})
    found = {(row.program.name, row.program.threads): row for row in rows}
    console.print(f"\n[bold]{title}[/]\nM springs/s, and how many times faster warp_springs is")
    table = Table()
    table.add_column("program", no_wrap=True)
    for count in counts:
        table.add_column(_cores(count), justify="right")
        table.add_column("", justify="right")
    table.add_column("differs by", justify="right")
    table.add_column("first use", justify="right")
    for name in sorted(names, key=lambda name: -_fastest(name, rows)):
        line = [name]
        mine = [found[name, count] for count in counts if (name, count) in found]
        for count in counts:
            line += _cells(found, name, count)
        line += [f"{mine[0].error:.0e} m", f"{mine[0].first_use:.1f} s"]
        table.add_row(*line)
    console.print(table)
    _remarks(console, rows)


def _remarks(console: Console, rows: list[Row]) -> None:
    """Why programs failed, and how those with other physics differ."""
    for row in rows:
        if row.failure:
            console.print(f"{row.program.name} on {_cores(row.program.threads)}: {row.failure}")
    differing = {row.program.differs: [] for row in rows if row.program.differs}
    for row in rows:
        if row.program.differs:
            differing[row.program.differs].append(row)
    for how, group in differing.items():
        names = " and ".join(dict.fromkeys(row.program.name for row in group))
        console.print(
            f"{names}: {how}; checked in free flight, where all must agree. In this scene the "
            f"typical robot strays by {max(row.strays for row in group):.0e} m."
        )


def _fastest(name: str, rows: list[Row]) -> float:
    return max((np.nan_to_num(row.rate) for row in rows if row.program.name == name), default=0.0)


def _cores(count: int) -> str:
    return "1 core" if count == 1 else f"{count} cores"


def _cells(found: dict, name: str, count: int) -> list[str]:
    """Rate and ratio; a program that uses fewer cores is compared with what it has."""
    ours = found.get((OURS, count))
    if (name, count) not in found:
        fewer = max(c for n, c in found if n == name)
        return ["", _ratio(ours.times_faster(found[name, fewer])) if ours else ""]
    row = found[name, count]
    if row.failure:
        return ["failed", ""]
    ratio = _ratio(ours.times_faster(row)) if ours and name != OURS else ""
    return [_rate(row.rate / 1e6), ratio]


def _rate(millions: float) -> str:
    return f"{millions:,.0f}" if millions >= 10 else f"{millions:.2g}"


def _ratio(value: float) -> str:
    if np.isnan(value):
        return ""
    return f"{value:.2f} x" if value < 10 else f"{value:,.0f} x"


def as_json(rows: list[Row], body: str, robots: int, springs: int) -> list[dict]:
    """The rows as plain values."""
    return [
        {
            "program": row.program.name,
            "body": body,
            "robots": robots,
            "springs_per_robot": springs,
            "precision": row.precision,
            "threads": row.program.threads,
            "features": row.program.differs or FEATURES,
            "error_m": _number(row.error),
            "allowed_error_m": ALLOWED[row.precision],
            "strays_m": _number(row.strays),
            "first_use_s": _number(row.first_use),
            "springs_per_second": _number(row.rate),
            "rates": [float(rate) for rate in row.rates],
            "failure": row.failure,
        }
        for row in rows
    ]


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def say_targets(console: Console, lines: list[dict]) -> None:
    """What is asked of warp_springs, and what these rows of the table give."""
    table = Table("population", "asked for", "found", "")
    for body, precision in dict.fromkeys((line["body"], line["precision"]) for line in lines):
        rows = [row for row in lines if (row["body"], row["precision"]) == (body, precision)]
        for text, value, least in _targets(rows, precision):
            if value is not None:
                met = "[green]met" if value >= least else "[red]missed"
                table.add_row(f"{body}s, {precision}", text, f"{value:.3g}", met)
    console.print("\n[bold]targets")
    console.print(table)


def _targets(rows: list[dict], precision: str):
    """Each target: what is asked for, what was found (None if that was not run), the least."""
    rates = {(row["program"], row["threads"]): row["rates"] for row in rows if row["rates"]}
    counts = sorted({threads for _, threads in rates})
    one, most = counts[0], counts[-1]

    def faster(names: tuple[str, ...], threads: int) -> float | None:
        """The least median ratio to any of the programs on so many threads, or on fewer."""
        ratios = []
        for name in names:
            has = [count for n, count in rates if n == name and count <= threads]
            if has and (OURS, threads) in rates:
                mine, theirs = rates[OURS, threads], rates[name, max(has)]
                ratios.append(float(np.median(np.divide(mine, theirs))))
        return min(ratios, default=None)

    if one == 1:
        yield "0.6 of the limit, one core", faster(("C++ limit",), one), 0.6
    if one == 1 < most and (OURS, most) in rates:
        both = np.divide(rates.get((OURS, most)), rates.get((OURS, one)))
        yield f"{most} cores 1.8 times one", float(np.median(both)), 1.8
    if precision == "float32" and (OURS, most) in rates:
        yield f"1.5 G springs/s, {most} cores", float(np.median(rates[OURS, most])) / 1e9, 1.5
        yield f"40 times Newton, {most} cores", faster(("Newton",), most), 40.0
    ordinary, expert = (
        ("NumPy", "Numba", "JAX", "Taichi"),
        (
            "Numba lanes",
            "Taichi lanes",
            "JAX unrolled",
        ),
    )
    yield f"5 times the fastest as written, {most} cores", faster(ordinary, most), 5.0
    yield f"1.5 times the best expert, {most} cores", faster(expert, most), 1.5


def write(path: Path, fleet: Fleet, **parts: list[dict]) -> dict:
    """Write the parts to a file and return all it holds.

    Rows of an earlier run on this machine stay where this run has no new ones.
    """
    known = json.loads(path.read_text()) if path.exists() else {}
    machine = {"processor": processor(), "cores": len(cores()), "system": platform.platform()}
    known = known if known.get("machine") == machine else {}
    versions = known.get("versions", {}) | fleet.versions | {"python": platform.python_version()}
    known |= {"machine": machine, "versions": versions, "failed": fleet.failed}
    for name, rows in parts.items():
        rows = {_key(row): row for row in [*known.get(name, []), *rows]}
        known[name] = list(rows.values())
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(known, indent=1) + "\n")
    return known


def _key(row: dict) -> tuple:
    return tuple(row[k] for k in ("body", "robots", "precision", "program", "threads"))
