"""Every picture of the README, made again.

    python benchmarks/pictures.py                    # all of them: half an hour on two cores
    python benchmarks/pictures.py scene.png zoo.png  # some of them, by name

They are written to benchmarks/figures. What needs a run of evolution makes one, of the walker
preset, in a folder that is kept with --run DIR and used again if it is there.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np

import warp_springs as ws

HERE = Path(__file__).parent
FILM_SIZE = (960, 540)
FILM_SECONDS = 3.0


class Studio:
    """Makes pictures, and the runs that they show.

    Attributes:
        figures: Where pictures go.
        run: Folder of the run of evolution.
    """

    def __init__(self, figures: Path, run: Path):
        self.figures, self.run = figures, run

    # -- of a run of evolution -----------------------------------------------------------------

    @cached_property
    def walkers(self) -> tuple[ws.Result, list[str]]:
        """The nine best of the walker preset, moving, and what is written beside them."""
        from evolve.reports.export import trial
        from evolve.reports.show import label
        from evolve.run import Run

        if not (self.run / "learning_curve.png").exists():
            _do("-m", "evolve.cli", "run", "walker", "--out", self.run)
        run = Run.open(self.run)
        with run.read() as store:
            zoo = store.finalists()[:9]
            motion = trial(run, store, [member.id for member in zoo], energy=True)
            return motion, [label(member) for member in zoo]

    def zoo(self) -> None:
        """The nine best, each in its tile."""
        motion, labels = self.walkers
        ws.render(motion, self.figures / "zoo.png", layout="panel", labels=labels)

    def zoo_film(self) -> None:
        """The same, running."""
        motion, labels = self.walkers
        ws.render(
            motion,
            self.figures / "zoo.webp",
            layout="panel",
            labels=labels,
            size=FILM_SIZE,
            fps=15,
            start=1.0,
            duration=FILM_SECONDS,
            clock=False,
        )

    def learning_curve(self) -> None:
        """Fitness against evaluations."""
        _ = self.walkers
        source = self.run / "learning_curve.png"
        (self.figures / "learning_curve.png").write_bytes(source.read_bytes())

    def overview(self) -> None:
        """Every plot of the champion's trial."""
        motion, _ = self.walkers
        ws.plots.overview(motion).savefig(self.figures / "overview.png", dpi=90)

    # -- of scenes -----------------------------------------------------------------------------

    def scene(self) -> None:
        """Bodies of four materials between obstacles, one of them pushed."""
        body = ws.shapes.lattice(4, 2, 1, edge=0.1, mass_per_vertex=0.1)
        body = body.made_of(ws.materials.TISSUE)
        for material, low in ((ws.materials.MUSCLE, 0.05), (ws.materials.BONE, 0.25)):
            body = body.made_of(material, where=lambda p, x=low: np.abs(p[:, 0] - x) < 0.06)
        body = body.made_of(ws.materials.MUSCLE2, where=lambda p: np.abs(p[:, 0] - 0.35) < 0.06)
        result = ws.Simulation([body], ws.Scene(damping=2.0)).run(1.2, fps=30)
        obstacles = (
            ws.Sphere(center=(-0.3, 0.3, 0.12), radius=0.12),
            ws.Box(center=(0.45, 0.55, 0.08), size=(0.16, 0.3, 0.16), angle=0.4),
        )
        shown = _with(result, obstacles, body.pushed([13, 14], (0.0, -4.0, 6.0)))
        ws.render(shown, self.figures / "scene.png", color="material", legend=True, frame=21)

    # -- of benchmarks -------------------------------------------------------------------------

    def work_precision(self) -> None:
        """Error against cost."""
        _do(HERE / "accuracy.py", "--figure", self.figures / "work_precision.png")

    def stability(self) -> None:
        """Which steps are stable."""
        figure = self.figures / "stability.png"
        _do(HERE / "stability.py", "--figure", figure, "--resolution", 48, "--soak", 0, "--rest", 0)

    def peers(self) -> None:
        """Springs per second of all programs; the first run makes their environments."""
        figure = self.figures / "peers.png"
        _do(HERE / "peers/run.py", "--part", "sweep", "--figure", figure)


PICTURES: dict[str, Callable[[Studio], None]] = {
    "zoo.png": Studio.zoo,
    "zoo.webp": Studio.zoo_film,
    "learning_curve.png": Studio.learning_curve,
    "overview.png": Studio.overview,
    "scene.png": Studio.scene,
    "work_precision.png": Studio.work_precision,
    "stability.png": Studio.stability,
    "peers.png": Studio.peers,
}
"""What can be made, by the name of its file."""


def _with(result: ws.Result, obstacles: tuple, robot: ws.Robot) -> ws.Result:
    """The same frames, shown with obstacles and with a robot that is pushed."""
    import dataclasses

    scene = dataclasses.replace(result.scene, obstacles=obstacles)
    return dataclasses.replace(result, scene=scene, robots=(robot,))


def _do(*words: object) -> None:
    """Run a program of this interpreter and let it talk."""
    subprocess.run([sys.executable, *map(str, words)], check=True)


def main() -> None:
    """Make what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(PICTURES)}")
    parser.add_argument("--run", type=Path, help="folder of the run of evolution, kept")
    parser.add_argument("--out", type=Path, default=HERE / "figures", help="where pictures go")
    options = parser.parse_args()
    if unknown := set(options.names) - set(PICTURES):
        parser.error(f"no picture is called {unknown.pop()}; there are {', '.join(PICTURES)}")
    ws.quiet()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(options.out, options.run or Path(folder, "walker"))
        for name in options.names or PICTURES:
            print(f"making {name}", flush=True)
            PICTURES[name](studio)


if __name__ == "__main__":
    main()
