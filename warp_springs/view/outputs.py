"""The files that a simulated scene leaves: result, animation, pictures, plots, parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from warp_springs.io.outputs import written_beside
from warp_springs.view.parameters import as_markdown, energy_change, outcome, parameters

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from warp_springs.config import SceneFile
    from warp_springs.result import Result

__all__ = ["energy_figure", "energy_panels", "save_figure", "write_outputs"]

MOST_PANELS = 12
"""Robots whose energies are plotted."""


def write_outputs(
    config: SceneFile, result: Result, folder: Path, findings: Sequence[tuple[str, str]] = ()
) -> list[Path]:
    """Write what a scene file asks for, its resolved configuration and all its parameters.

    Args:
        config: The scene.
        result: What came of it.
        folder: Where the files go; made if it is missing.
        findings: Further rows of the table of parameters, before all others.

    Returns:
        The files that people open, in the order in which they were written.
    """
    import warp_springs as ws
    from warp_springs.config import dump

    folder.mkdir(parents=True, exist_ok=True)
    record = config.record
    look = {"names": {i: config.names[i] for i in result.recorded}, "grid": record.grid}
    shown = list(result.recorded[: ws.config.MOST_SHOWN])
    labels = [config.names[i] for i in shown] if len(shown) > 1 else None
    picture = {"robots": shown, "labels": labels, "color": record.color}
    writers: dict[str, tuple[str, Callable[[Path], object]]] = {
        "result": (".npz", result.save),
        "usd": (".usdc", lambda path: ws.export_usd(result, path, color=record.color, **look)),
        "picture": (".png", lambda path: ws.render(result, path, **picture)),
        "energies": (
            "_energies.png",
            lambda path: save_figure(energy_figure(config, result), path),
        ),
        "page": (
            ".html",
            lambda path: ws.export_html(
                result, path, title=config.name, color=record.color, **look
            ),
        ),
        "mesh": (".pvd", lambda path: ws.write_mesh(result, path, robot=result.recorded[0])),
    }
    paths = []
    for name, (ending, write) in writers.items():
        if name in record.write:
            paths.append(folder / f"{config.name}{ending}")
            write(paths[-1])
    shows = [*findings, *outcome(result)]
    table = as_markdown(config.name, config.about, shows, parameters(config, result))
    for ending, text in (("_parameters.md", table), (".toml", dump(config))):
        paths.append(folder / f"{config.name}{ending}")
        with written_beside(paths[-1]) as draft:
            draft.write_text(text, encoding="utf-8")
    return paths


def energy_figure(config: SceneFile, result: Result) -> Figure:
    """Energies over time, a panel for each robot, and by how much the total varies."""
    shown = range(min(len(result), MOST_PANELS))
    figure = energy_panels([(config.names[i], result, i) for i in shown])
    change, residual = energy_change(result)
    figure.suptitle(
        f"{config.name}: the total energy varies by {change:.2g} %; "
        f"{residual:.2g} % is unexplained by the ledger"
    )
    return figure


def energy_panels(panels: Sequence[tuple[str, Result, int]]) -> Figure:
    """Energies over time, a panel with a name for each robot of a result."""
    import warp_springs as ws

    alone = len(panels) == 1
    columns = min(4, math.ceil(math.sqrt(len(panels))))
    rows = -(-len(panels) // columns)
    figure = ws.plots.figure(9.0, 6.0) if alone else ws.plots.figure(4.6 * columns, 1 + 3.2 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (name, result, robot) in zip(axes, panels, strict=False):
        ws.plots.energies(ax, result, robot, strip=alone)
        if not alone:
            ax.get_legend().remove()
            ax.set_title(name, loc="left", fontsize="medium")
    if not alone:
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=6, frameon=False)
    for ax in axes[len(panels) :]:
        ax.remove()
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as a picture, whole or not at all."""
    with written_beside(path) as draft:
        figure.savefig(draft, dpi=120, bbox_inches="tight", pad_inches=0.15)
