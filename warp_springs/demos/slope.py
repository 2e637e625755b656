"""A cube on a slope for each pair of surfaces: predicted and measured.

The slope is gravity that is tilted. Below atan(mu_s) a cube must stay where it is, above it must
slide with a = g (sin - mu_k cos).

A cube is first left to rest, strongly damped, and then released. One that shall stay rests on its
slope, on a friction that just holds it: so each foot is pulled in proportion to what it bears, and
none begins beyond its limit. One that shall slide rests with the slope's normal force alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_springs.materials import FRICTION, Friction
from warp_springs.scene import Ground, Scene
from warp_springs.simulation import Simulation

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from warp_springs.config import SceneFile
    from warp_springs.result import Result
    from warp_springs.robot import Robot

__all__ = ["Trial", "demonstrate", "tilted", "trials"]

STICKING = 0.9
"""Slope on which a cube must stay, as a part of atan(mu_s)."""
BEYOND = math.radians(3.0)
"""How much steeper the slope is on which it must slide."""
HOLDING = 1.02
"""Friction that holds a cube until it is released, as a multiple of the least that would."""
SETTLING = 1.0
"""How long a cube comes to rest first [s]."""
SETTLING_DAMPING = 30.0
"""[1/s]"""


HEADINGS = [
    "surfaces",
    "mu_s",
    "mu_k",
    "stays at [°]",
    "creep [nm]",
    "slides at [°]",
    "predicted [m/s²]",
    "measured [m/s²]",
]


@dataclass(frozen=True)
class Trial:
    """One pair of surfaces.

    Attributes:
        pair: The surfaces.
        friction: Their coefficients.
        stick_angle: Slope on which the cube must stay [rad].
        creep: Way that it went nevertheless [m].
        slide_angle: Slope on which it must slide [rad].
        predicted: g (sin - mu_k cos) [m/s^2].
        measured: Acceleration of the centre of mass [m/s^2].
        result: The run in which it slid.
    """

    pair: tuple[str, str]
    friction: Friction
    stick_angle: float
    creep: float
    slide_angle: float
    predicted: float
    measured: float
    result: Result


def trials(config: SceneFile, pairs: Mapping[tuple[str, str], Friction] = FRICTION) -> list[Trial]:
    """Simulate the cube of a scene file on two slopes for each pair of surfaces."""
    cube = config.build_robots()[0]
    scene = config.scene.build()
    g = math.hypot(*scene.gravity)
    done = []
    for pair, friction in pairs.items():
        ground = replace(
            scene.ground or Ground(),
            static_friction=friction.static,
            kinetic_friction=friction.kinetic,
        )
        world = replace(scene, ground=ground)
        stick = STICKING * math.atan(friction.static)
        slide = math.atan(max(friction)) + BEYOND
        stuck = _released(config, cube, replace(world, gravity=tilted(g, stick)), held=True)
        slid = _released(config, cube, replace(world, gravity=tilted(g, slide)), held=False)
        done.append(
            Trial(
                pair,
                friction,
                stick,
                float(np.abs(_way(stuck)).max()),
                slide,
                g * (math.sin(slide) - friction.kinetic * math.cos(slide)),
                _acceleration(slid),
                slid,
            )
        )
    return done


def tilted(g: float, angle: float) -> tuple[float, float, float]:
    """Gravity [m/s^2] on a slope of an angle [rad] that falls along +x."""
    return (g * math.sin(angle), 0.0, -g * math.cos(angle))


def _released(config: SceneFile, cube: Robot, scene: Scene, held: bool) -> Result:
    """A run that begins with a cube at rest, held on the slope before or not loaded by it yet."""
    along, _, normal = scene.gravity
    before = replace(scene, damping=SETTLING_DAMPING)
    if held:
        enough = HOLDING * along / -normal
        ground = replace(scene.ground, static_friction=enough, kinetic_friction=enough)
        before = replace(before, ground=ground)
    else:
        before = replace(before, gravity=(0.0, 0.0, normal))
    resting = Simulation(cube, before).run(SETTLING)
    start = cube.replace(positions=resting.positions(0), velocities=None)
    settings = config.simulation.model_dump(exclude={"duration"})
    simulation = Simulation(start, scene, **settings)
    return simulation.run(config.simulation.duration, fps=config.record.fps, energy=True)


def _way(result: Result) -> np.ndarray:
    """Way of the centre of mass down the slope at each frame [m], shape (F,)."""
    robot = result.robots[0]
    x = result.frames(0)[:, :, 0] @ robot.masses / robot.mass
    return x - x[0]


def _acceleration(result: Result) -> float:
    """Of x = v t + a t^2 / 2, fitted to the way: vibrations of the cube average out."""
    t = result.times
    fit = np.linalg.lstsq(np.stack([t, t**2 / 2.0], axis=1), _way(result), rcond=None)[0]
    return float(fit[1])


def demonstrate(config: SceneFile, folder: Path, console: Console) -> int:
    """Run all trials, write table, plots and animations, and say what was written."""
    from rich.markup import escape

    import warp_springs as ws
    from warp_springs.config import dump
    from warp_springs.io.outputs import written_beside
    from warp_springs.view.outputs import save_figure
    from warp_springs.view.parameters import as_markdown, outcome, parameters

    console.print(
        f"[bold]{escape(config.name)}[/]  {escape(config.about)}", highlight=False, soft_wrap=True
    )
    with console.status("simulating"):
        done = trials(config)
    folder.mkdir(parents=True, exist_ok=True)
    _print(console, done)
    paths = []
    for trial in done:
        paths.append(folder / f"slope_{'_on_'.join(trial.pair).replace(' ', '_')}.usdc")
        ws.export_usd(trial.result, paths[-1])
    for ending, figure in ((".png", _figure(done)), ("_energies.png", _energies(done))):
        paths.append(folder / f"slope{ending}")
        save_figure(figure, paths[-1])
    slid = done[3].result
    tables = as_markdown(config.name, config.about, outcome(slid), parameters(config, slid))
    for ending, content in (
        ("_parameters.md", f"{tables}\n{_markdown(done)}"),
        (".toml", dump(config)),
    ):
        paths.append(folder / f"slope{ending}")
        with written_beside(paths[-1]) as draft:
            draft.write_text(content, encoding="utf-8")
    print("wrote")
    for path in paths:
        print(f"  {path}")
    return 3 if any(trial.result.status.any() for trial in done) else 0


def _cells(trial: Trial) -> list[str]:
    stick, slide = math.degrees(trial.stick_angle), math.degrees(trial.slide_angle)
    figures = [f"{trial.friction.static:g}", f"{trial.friction.kinetic:g}", f"{stick:.2f}"]
    figures += [f"{1e9 * trial.creep:.2g}", f"{slide:.2f}"]
    return [" on ".join(trial.pair), *figures, f"{trial.predicted:.4f}", f"{trial.measured:.4f}"]


def _markdown(done: list[Trial]) -> str:
    rows = [HEADINGS, ["---"] * len(HEADINGS), *map(_cells, done)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows) + "\n"


def _print(console: Console, done: list[Trial]) -> None:
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="dim")
    for number, heading in enumerate(HEADINGS):
        name, _, unit = heading.partition(" [")
        words = escape(f"{name}\n[{unit}" if unit else name)
        table.add_column(words, justify="right" if number else "left", no_wrap=number > 0)
    for trial in done:
        table.add_row(*_cells(trial))
    console.print(table, highlight=False)


def _figure(done: list[Trial]) -> Figure:
    """Ways down the slopes: lines measured, dots predicted."""
    import warp_springs as ws
    from warp_springs.view.plots.style import SERIES

    figure = ws.plots.figure(10.0, 6.0)
    ax = figure.subplots()
    for number, trial in enumerate(done):
        t = trial.result.times
        color, style = SERIES[number % len(SERIES)], ("-", "--")[number // len(SERIES)]
        label = f"{' on '.join(trial.pair)}, {math.degrees(trial.slide_angle):.1f}°"
        ax.plot(t, _way(trial.result), style, color=color, linewidth=1.6, label=label)
        dots = t[::6]
        ax.plot(dots, trial.predicted * dots**2 / 2.0, "o", color=color, markersize=3.5)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("way down the slope [m]")
    ax.set_title("lines: measured; dots: g (sin − mu_k cos) t² / 2", fontsize="medium")
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(alpha=0.25)
    figure.legend(loc="outside right center", frameon=False, fontsize="small")
    return figure


def _energies(done: list[Trial]) -> Figure:
    from warp_springs.view.outputs import energy_panels

    return energy_panels([(" on ".join(t.pair), t.result, 0) for t in done])
