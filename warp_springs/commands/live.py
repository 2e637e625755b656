"""``--live``: a simulation as a page on this machine while it runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from warp_springs.config import SceneFile
    from warp_springs.simulation import Simulation

__all__ = ["watching"]

SHARE = 0.1
"""Share of the time that may go into pages of the frames so far."""
MOST_SHOWN = 16
"""Robots on the page."""


@contextmanager
def watching(
    config: SceneFile, place: tuple[str, int], console: Console
) -> Iterator[Callable[[Simulation, float], None]]:
    """Serve a page within; yields what is to be told how far the simulation is."""
    from warp_springs.view.pages.live import LiveServer

    with LiveServer(f"{config.name} is running", *place) as server:
        console.print(f"[dim]live  [/]{server.url}", highlight=False, soft_wrap=True)
        yield _Watcher(config, server)


class _Watcher:
    """Keeps the page up to date: how far, the energies of the first robot, the frames so far."""

    def __init__(self, config: SceneFile, server) -> None:
        self._config, self._server = config, server
        self._started = time.perf_counter()
        self._drawing = 0.0
        self._frames = 0

    def __call__(self, simulation: Simulation, done: float) -> None:
        now = time.perf_counter()
        if self._drawing > SHARE * (now - self._started):
            return
        found = simulation.so_far()
        if found is not None:
            self._show(found, done)
        self._drawing += time.perf_counter() - now

    def _show(self, found, done: float) -> None:
        from warp_springs.view.pages.live import LiveLine
        from warp_springs.view.pages.player import html_page

        config, seconds = self._config, self._config.simulation.duration
        passed = max(time.perf_counter() - self._started, 1e-9)
        shown = found.recorded[:MOST_SHOWN]
        name = config.names[shown[0]]
        if found.energy is None:
            frames, robot = found.frames(shown[0]), found.robots[shown[0]]
            curve, unit = f"height of {name}", "m"
            values = frames[:, :, 2] @ robot.masses / robot.mass
        else:
            curve, unit, values = f"energy of {name}", "J", found.energy.total[shown[0]]
        self._server.show(
            done=done,
            words=f"{round(done * seconds, 2):,.7g} of {seconds:,.7g} s",
            facts=[
                ("robots", f"{len(found):,}"),
                ("frames", f"{len(found.times):,}"),
                ("pace", f"{done * seconds / passed:,.2f} times real time"),
            ],
            curve=curve,
            unit=unit,
            x=found.times,
            x_name="time [s]",
            lines=[LiveLine("total" if found.energy else "centre of mass", "#c8452d", values)],
        )
        if len(found.times) > max(self._frames, 1):
            self._frames = len(found.times)
            names = {i: config.names[i] for i in shown}
            page = html_page(found, robots=shown, names=names, title=config.name,
                             color=config.record.color, grid=config.record.grid)  # fmt: skip
            self._server.show_robots(page)
