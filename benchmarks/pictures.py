"""Every picture of the README, made again.

    python benchmarks/pictures.py                    # all of them: half an hour on two cores
    python benchmarks/pictures.py scene.png zoo.png  # some of them, by name

They are written to benchmarks/figures. What needs runs of evolution makes them, of the packaged
presets, in a folder that is kept with --runs DIR, where those that are there are used again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

import warp_springs as ws

HERE = Path(__file__).parent
ZOO = (
    *("walker", "creature", "tripod"),
    *("blueprint", "starfish", "critter"),
    *("worm", "octahedron", "snake"),
)
"""Presets whose champions are shown, row by row."""
COLUMNS = 3
TILE, FILM_TILE = (424, 238), (318, 178)
GAP = 4
FILM_SECONDS, FILM_FPS = 3.0, 15


class Studio:
    """Makes pictures, and the runs that they show.

    Attributes:
        figures: Where pictures go.
        runs: Folder of the runs of evolution.
    """

    def __init__(self, figures: Path, runs: Path):
        self.figures, self.runs = figures, runs

    # -- of runs of evolution ------------------------------------------------------------------

    def evolved(self, preset: str) -> Path:
        """Folder of a finished run of a preset."""
        folder = self.runs / preset
        if not (folder / "learning_curve.png").exists():
            _do("-m", "evolve.cli", "run", preset, "--out", folder)
        return folder

    @cached_property
    def champions(self) -> dict[str, tuple[ws.Result, str]]:
        """The champion of each preset of the zoo, moving, and what is written beside it."""
        return {preset: self._champion(preset) for preset in ZOO}

    def _champion(self, preset: str) -> tuple[ws.Result, str]:
        from evolve.reports.export import trial
        from evolve.run import Run

        run = Run.open(self.evolved(preset))
        with run.read() as store:
            best = store.finalists()[0]
            motion = trial(run, store, [best.id], energy=True)
        return motion, f"{preset}   {best.fitness:.2f}"

    def zoo(self) -> None:
        """The champions, each in its tile."""
        with tempfile.TemporaryDirectory() as folder:
            tiles = []
            for preset, (motion, label) in self.champions.items():
                path = Path(folder, f"{preset}.png")
                ws.render(motion, path, caption=label, size=TILE)
                tiles.append(Image.open(path).convert("RGB"))
            _panel(tiles).save(self.figures / "zoo.png")

    def zoo_film(self) -> None:
        """The same, running: the last seconds of their trials."""
        with tempfile.TemporaryDirectory() as folder:
            films = []
            for preset, (motion, label) in self.champions.items():
                path = Path(folder, f"{preset}.webp")
                ws.render(
                    motion,
                    path,
                    caption=label,
                    size=FILM_TILE,
                    fps=FILM_FPS,
                    start=motion.times[-1] - FILM_SECONDS,
                    duration=FILM_SECONDS,
                    clock=False,
                )
                with Image.open(path) as film:
                    films.append([f.convert("RGB") for f in ImageSequence.Iterator(film)])
        first, *others = [_panel(tiles) for tiles in zip(*films, strict=True)]
        first.save(
            self.figures / "zoo.webp",
            save_all=True,
            append_images=others,
            duration=round(1000 / FILM_FPS),
            loop=0,
            quality=65,
            method=6,
        )

    def learning_curve(self) -> None:
        """Fitness against evaluations."""
        source = self.evolved("walker") / "learning_curve.png"
        (self.figures / "learning_curve.png").write_bytes(source.read_bytes())

    def overview(self) -> None:
        """Every plot of the walker's trial."""
        motion, _ = self._champion("walker")
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


def _panel(tiles: Sequence[Image.Image]) -> Image.Image:
    """Tiles of one size side by side, row by row, with white gaps."""
    width, height = (n + GAP for n in tiles[0].size)
    rows = -(-len(tiles) // COLUMNS)
    panel = Image.new("RGB", (COLUMNS * width - GAP, rows * height - GAP), "white")
    for i, tile in enumerate(tiles):
        panel.paste(tile, (i % COLUMNS * width, i // COLUMNS * height))
    return panel


def _do(*words: object) -> None:
    """Run a program of this interpreter and let it talk."""
    subprocess.run([sys.executable, *map(str, words)], check=True)


def main() -> None:
    """Make what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(PICTURES)}")
    parser.add_argument("--runs", type=Path, help="folder of the runs of evolution, kept")
    parser.add_argument("--out", type=Path, default=HERE / "figures", help="where pictures go")
    options = parser.parse_args()
    if unknown := set(options.names) - set(PICTURES):
        parser.error(f"no picture is called {unknown.pop()}; there are {', '.join(PICTURES)}")
    ws.quiet()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(options.out, options.runs or Path(folder))
        for name in options.names or PICTURES:
            print(f"making {name}", flush=True)
            PICTURES[name](studio)


if __name__ == "__main__":
    main()
