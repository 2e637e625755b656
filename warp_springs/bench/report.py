"""What was measured, as a table in the terminal and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from warp_springs.bench.measure import Row

__all__ = ["as_json", "show", "write"]


def show(console: Console, title: str, rows: Sequence[Row]) -> None:
    """Print the rows of a section; what all have in common stands above them."""
    columns = {
        "robots": [f"{row.case.robots:,}" for row in rows],
        "springs": [f"{row.springs:,}" for row in rows],
        "features": [" ".join(row.case.features) or "none" for row in rows],
        "topology": ["shared" if row.case.alike else "own" for row in rows],
        "layout": [row.case.layout for row in rows],
        "integrator": [row.case.integrator for row in rows],
        "precision": [row.case.precision for row in rows],
        "threads": [str(row.case.threads) for row in rows],
    }
    varying = [name for name, values in columns.items() if len(set(values)) > 1]
    common = [
        f"{name} {values[0]}" for name, values in columns.items() if values and name not in varying
    ]
    made = Table()
    for name in varying:
        words = name in ("features", "topology", "layout", "integrator", "precision")
        made.add_column(name, justify="left" if words else "right")
    for name in ("M springs/s", "error [m]", "first use [s]"):
        made.add_column(escape(name), justify="right")
    for index, row in enumerate(rows):
        made.add_row(*(columns[name][index] for name in varying), *_measured(row))
    console.print(f"\n[bold]{title}[/]\n[dim]{', '.join(common)}[/]")
    console.print(made)


def _measured(row: Row) -> tuple[str, str, str]:
    if row.missing:
        return "[dim]not here", "", ""
    error = f"{row.error:.0e}"
    if row.wrong:
        return "[bold red]WRONG", f"[bold red]{error}", ""
    rate = row.rate / 1e6
    return f"{rate:,.0f}" if rate >= 10 else f"{rate:.1f}", error, f"{row.first_use:.2f}"


def as_json(section: str, rows: Sequence[Row]) -> list[dict]:
    """The rows as plain values."""
    return [
        {
            "section": section,
            **asdict(row.case),
            "springs_per_robot": row.springs,
            "error_m": _number(row.error),
            "allowed_error_m": row.allowed,
            "first_use_s": _number(row.first_use),
            "springs_per_second": _number(row.rate),
            "rates": row.rates,
            "wrong": row.wrong,
            "missing": row.missing,
        }
        for row in rows
    ]


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def write(path: Path, machine: dict, lines: Sequence[dict]) -> None:
    """Write the machine and all rows."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"machine": machine, "rows": lines}, indent=1) + "\n")
