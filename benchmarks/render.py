"""How long a picture takes: the 3 x 3 zoo at 1280 x 720 with shadows and anti-aliasing, one core.

    python benchmarks/render.py
    python benchmarks/render.py --peer            # beside PyVista in the same run

PyVista comes from PyPI into an environment of its own, made once and kept in
benchmarks/peers/.cache (0.8 GB); its OpenGL is VTK's own, in software where there is no display.
Both draw the same nine robots, on one core. Beside the time that passes stands the time of the
processor, which on a machine with other work to do is what a picture costs. Before a time is
printed, the picture is drawn twice, with one thread and with two, and must be the same to the bit.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from peers.environments import python_of

import warp_springs as ws
from warp_springs.view import appearance
from warp_springs.view.look import Cut, Look
from warp_springs.view.pictures.film import Film
from warp_springs.view.pictures.rasteriser import TO_SUN, Rasteriser

SIZE = (1280, 720)
FRAMES = 15


def zoo() -> ws.Result:
    """Nine different bodies of voxels with muscles, a moment after they began to move."""
    rng = np.random.default_rng(9)
    robots = []
    while len(robots) < 9:
        mask = rng.random((3, 3, 2)) < 0.75
        mask[:, :, 0] |= rng.random((3, 3)) < 0.5
        try:
            body = ws.shapes.voxels(mask)
        except ValueError:
            continue
        robots.append(
            body.replace(
                stiffness=3000.0,
                amplitude=0.08 * body.rest_length,
                phase=rng.uniform(0.0, 6.0, body.n_springs),
                omega=2.0 * np.pi,
            )
        )
    return ws.Simulation(robots, ws.Scene(damping=1.0)).run(0.5, fps=30)


def film(result: ws.Result, threads: int) -> Film:
    """The zoo as it is filmed."""
    rasteriser = Rasteriser(SIZE, threads=threads)
    cut = Cut(fps=30.0, clock=False)
    return Film(result, list(result.recorded), Look(layout="grid"), cut, rasteriser)


def timed(pictures: Film) -> list[tuple[float, float]]:
    """Seconds of each of some pictures, everything included that a film does for one.

    Those that pass, and those of the processor.
    """
    seconds = []
    for k in range(FRAMES):
        start, busy = time.perf_counter(), time.process_time()
        pictures.picture(k % len(pictures))
        seconds.append((time.perf_counter() - start, time.process_time() - busy))
    return seconds


def hand_over(pictures: Film, folder: Path) -> None:
    """Write what a peer needs to draw the same."""
    shot = pictures.shots[0][0]
    time_shown = float(pictures.times[0])
    camera = shot.director.camera(time_shown)
    actors = shot.actors
    counts = np.cumsum([0, *(a.body.n_masses for a in actors[:-1])])
    colors = np.concatenate([a.colors(time_shown) for a in actors])
    sizes = [float(np.linalg.norm(a.high[0] - a.low[0])) for a in actors]
    np.savez(
        folder / "scene.npz",
        size=SIZE,
        points=np.concatenate([a.positions(time_shown) for a in actors]),
        springs=np.concatenate([a.body.springs + c for a, c in zip(actors, counts, strict=True)]),
        faces=np.concatenate([a.body.faces + c for a, c in zip(actors, counts, strict=True)]),
        colors=np.rint(255 * appearance.to_screen(colors)).astype(np.uint8),
        bar=actors[0].bar,
        ball=actors[0].ball,
        floor=-actors[0].ball,
        tile=appearance.tile_size(sizes),
        eye=camera.eye,
        target=camera.target,
        angle=camera.field_of_view,
        sun=np.array(TO_SUN),
    )


def on_one_core() -> None:
    """Bind this process and its children to one core, where the system can."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def row(name: str, seconds: list[tuple[float, float]]) -> str:
    """A line of the table, in ms."""
    ms, busy = 1e3 * np.array(seconds).T
    shown = np.median(busy), np.median(ms), ms.min(), ms.max()
    return f"{name:<44}" + "".join(f"{value:10.0f}" for value in shown)


def main() -> None:
    """Draw, check, time, compare."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--peer", action="store_true", help="PyVista draws the same")
    parser.add_argument("--out", type=Path, help="keep the pictures in this folder")
    options = parser.parse_args()
    ws.quiet()
    result = zoo()
    springs = sum(robot.n_springs for robot in result.robots)
    pictures = film(result, threads=1)
    first = pictures.picture(0)
    if not (np.array_equal(first, pictures.picture(0)) and same_with_two_threads(result, first)):
        raise SystemExit("the same picture was not the same to the bit")
    with tempfile.TemporaryDirectory() as folder:
        folder = options.out or Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        ws.render(result, folder / "warp_springs.png", frame=0, layout="grid", size=SIZE)
        hand_over(pictures, folder)
        on_one_core()
        print(f"nine robots, {springs:,} springs, {SIZE[0]} x {SIZE[1]}, one core; bits the same")
        print(f"{'ms a picture':<44} {'processor':>9} {'median':>9} {'least':>9} {'most':>9}")
        print(row("warp_springs, shadows, 4 samples a pixel", timed(pictures)), flush=True)
        if options.peer:
            beside(python_of("pyvista"), folder)
            print(row("warp_springs, again", timed(pictures)))


def same_with_two_threads(result: ws.Result, pixels: np.ndarray) -> bool:
    """Whether two threads draw the same bits."""
    return np.array_equal(film(result, threads=2).picture(0), pixels)


def beside(peer: Path, folder: Path) -> None:
    """Let PyVista draw the same, and print its times."""
    script = Path(__file__).with_name("render_peer.py")
    done = subprocess.run([peer, script, folder], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"PyVista failed:\n{done.stderr[-2000:]}")
    for line in done.stdout.splitlines():
        found = json.loads(line)
        print(row(f"PyVista, {found['mode']}", found["seconds"]), flush=True)


if __name__ == "__main__":
    main()
