"""The tables of the accuracy benchmark."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from accuracy_claims import Claim
from accuracy_measure import Row, Series, cost_of, recommended, series_of, step_name
from accuracy_peer import Comparison
from accuracy_scenes import Case, Truth
from rich.box import SIMPLE_HEAD
from rich.table import Table

__all__ = ["peers", "recommendations", "scene", "verdicts"]


def scene(name: str, case: Case, truth: Truth, rows: Sequence[Row]) -> Table:
    """The recommended step of each series in a scene, and what the accuracy costs.

    Subs are the contact sub-steps within a drift. Spring evaluations and microseconds are those of
    one robot, interpolated to the accuracy itself; M/s is the largest number of evaluations a
    second, in millions; robots were in the batch that took the recommended step.
    """
    judged = "" if case.judged == 1 else f", median of {case.judged} robots"
    title = (
        f"{name}: {case.title}, {case.duration:g} s, {case.robot.n_springs} springs\n"
        f"{case.features}; truth: {truth.source}, good to {truth.uncertainty:.0e} m\n"
        f"error below {case.target:.1e} m, {100 * case.fraction:g} % of {case.of}{judged}"
    )
    table = _table(title, "method", "precision", justify="left")
    for column in ("subs", "step", "evals", "µs/robot", "order", "robots", "M/s"):
        table.add_column(column, justify="right", no_wrap=True)
    for series in series_of(case):
        own = [row for row in rows if row.scene == name and row.series == series]
        best = recommended(own, case.target)
        count, seconds = (cost_of(own, case.target, cost) for cost in ("evaluations", "seconds"))
        fastest = max(own, key=lambda row: row.evaluations / row.seconds)
        table.add_row(
            series.integrator,
            series.precision,
            "" if series.substeps == "none" else str((best or own[-1]).contact_substeps),
            step_name(best.dt) if best else "-",
            f"{count:,.0f}" if count else "-",
            f"{seconds * 1e6:,.1f}" if seconds else "-",
            _order(own, truth) if series.precision == "float64" else "",
            str(best.robots) if best else "-",
            f"{fastest.evaluations / fastest.seconds / 1e6:,.0f}",
        )
    return table


def recommendations(cases: Mapping[str, Case], rows: Sequence[Row]) -> Table:
    """The largest good step of each integrator in each scene, float64."""
    table = _table("Recommended steps, float64", "scene")
    table.add_column("error [m]", no_wrap=True)
    ways = (("chin4", "chosen"), ("chin4", "one"), ("leapfrog", "chosen"), ("leapfrog", "one"))
    ways = (*ways, ("euler", "none"))
    for integrator, substeps in ways:
        one = ",\n1 sub-step" if substeps == "one" else ""
        table.add_column(integrator + one, justify="right", no_wrap=True)
    for name, case in cases.items():
        steps = []
        for integrator, substeps in ways:
            substeps = substeps if case.scene.ground else "none" if substeps != "one" else "one"
            series = Series(integrator, "float64", substeps)
            own = [row for row in rows if row.scene == name and row.series == series]
            best = recommended(own, case.target)
            steps.append(step_name(best.dt) if best else "-" if own else "")
        table.add_row(name, f"{case.target:.1e}", *steps)
    return table


def peers(comparisons: Sequence[Comparison]) -> Table:
    """Two kernels a step against us, at one accuracy, side by side."""
    title = "One accuracy: two kernels a step (symplectic Euler, atomics, one core), and here"
    table = _table(title, "", justify="left")
    rows = {
        "error": lambda c: f"{c.target:.0e} m",
        "here": lambda c: str(c.ours),
        "step, theirs": lambda c: step_name(c.their_dt),
        "step, here": lambda c: step_name(c.dt),
        "error, theirs": lambda c: f"{c.their_error:.1e} m",
        "error, here": lambda c: f"{c.error:.1e} m",
        "evaluations, theirs": lambda c: f"{c.evaluations[1]:,.0f}",
        "evaluations, here": lambda c: f"{c.evaluations[0]:,.0f}",
        "µs a robot, theirs": lambda c: f"{1e6 * c.seconds[1]:,.0f}",
        "µs a robot, here": lambda c: f"{1e6 * c.seconds[0]:,.0f}",
        "cores, here": lambda c: str(c.threads),
        "seconds, theirs / here": lambda c: f"[bold]{c.ratio:,.0f} x",
        "the same per core": lambda c: f"{c.ratio / c.threads:,.0f} x",
        "both as euler: differ": lambda c: f"{c.difference:.0e} m",
    }
    for c in comparisons:
        table.add_column(c.scene.replace(", ", ",\n"), justify="right")
    for label, text in rows.items():
        table.add_row(label, *(text(c) for c in comparisons))
    return table


def verdicts(claims: Sequence[Claim]) -> Table:
    """What holds and what does not."""
    table = _table("What holds", "", "claim", "with")
    table.add_column("measured", justify="right")
    table.add_column("expected", justify="right")
    before = None
    for claim in claims:
        low, high = claim.allowed
        expected = f">= {low:g}" if math.isinf(high) else f"<= {high:g}" if low == 0.0 else None
        table.add_row(
            "[green]yes" if claim.holds else "[red]no",
            "" if claim.about == before else claim.about,
            claim.how,
            f"{claim.measured:.3g} {claim.unit}",
            f"{expected or f'{low:g} to {high:g}'} {claim.unit}",
        )
        before = claim.about
    return table


def _table(title: str, *columns: str, justify: str = "center") -> Table:
    table = Table(
        title=title,
        title_justify=justify,
        title_style="bold",
        box=SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    for column in columns:
        table.add_column(column, no_wrap=column in ("scene", "method", "precision"))
    return table


def _order(rows: Sequence[Row], truth: Truth) -> str:
    """Slope of error over step, between the errors that mean anything."""
    meaningful = max(1e-12, 10 * truth.uncertainty)
    points = [(row.dt, row.error) for row in rows if meaningful < row.error < 1e-3]
    if len(points) < 3:
        return "-"
    return f"{np.polyfit(*np.log(np.transpose(points)), 1)[0]:.1f}"
