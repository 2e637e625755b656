"""What an animation costs: seconds, megabytes on the disk, and memory.

    python benchmarks/export.py [--geometry skel] [--json FILE]

Exports a generation (100 different robots of 50 masses and 300 springs, 300 frames) and one large
body (1,000 masses, 9,939 springs, 300 frames), with stress colours, from result files; and the
generation again with four times as many frames: the memory above what the process held before must
not grow with them. On a machine with other work to do, the seconds of the processor are what an
export costs. Every export runs in a process of its own, and what it wrote is opened again before a
figure is printed.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import warp_springs as ws

FPS = 30


def generation(frames: int) -> ws.Result:
    """100 robots, no two of one topology, walking."""
    rng = np.random.default_rng(1)
    return simulated([different(rng) for _ in range(100)], frames)


def different(rng: np.random.Generator) -> ws.Robot:
    """A plate of 50 masses of which each has lost other springs, breathing at random."""
    body = ws.shapes.lattice(4, 4, 1, stiffness=5000.0)
    kept = np.sort(rng.permutation(body.n_springs)[:300])
    return ws.Robot(
        masses=body.masses,
        positions=body.positions + rng.normal(0.0, 0.004, body.positions.shape) + (0, 0, 0.02),
        springs=body.springs[kept],
        stiffness=body.stiffness[kept],
        faces=body.faces,
        amplitude=0.1 * body.rest_length[kept],
        phase=rng.uniform(0.0, 6.28, 300),
        omega=6.28,
    )


def large(frames: int) -> ws.Result:
    """One bar of 1,000 masses, bending as it breathes."""
    body = ws.shapes.lattice(24, 7, 4, stiffness=5000.0)
    wave = 6.28 * body.positions[body.springs].mean(axis=1)[:, 0]
    return simulated(
        [body.replace(amplitude=0.1 * body.rest_length, phase=wave, omega=6.28)], frames
    )


def simulated(robots: list[ws.Robot], frames: int) -> ws.Result:
    """A run of so many frames."""
    scene = ws.Scene(damping=1.0)
    return ws.Simulation(robots, scene, precision="float32").run((frames - 1) / FPS, fps=FPS)


CASES = {
    "100 robots, 300 frames": (generation, 300),
    "100 robots, 1,200 frames": (generation, 1200),
    "1,000 masses, 300 frames": (large, 300),
}


class Memory(threading.Thread):
    """The most memory that this process held, looked at every 5 ms (Linux; 0 elsewhere)."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.before = self.most = self.now()
        self.start()

    def run(self) -> None:
        """Look, again and again."""
        while True:
            self.most = max(self.most, self.now())
            time.sleep(0.005)

    @staticmethod
    def now() -> int:
        """Bytes of its own: pages of mapped files are the system's to take back."""
        status = Path("/proc/self/status")
        lines = status.read_text().splitlines() if status.exists() else []
        return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("RssAnon"))


def export(source: Path, geometry: str) -> dict[str, float]:
    """Export a result file; what it took."""
    result = ws.Result.load(source)
    target = source.with_suffix(".usdc")
    ws.export_usd(ws.Simulation(ws.shapes.cube()).run(0.1, fps=FPS), target)  # modules loaded
    memory = Memory()
    start, busy = time.perf_counter(), time.process_time()
    ws.export_usd(result, target, **({} if geometry == "default" else {"geometry": geometry}))
    seconds, busy = time.perf_counter() - start, time.process_time() - busy
    grown = memory.most - memory.before
    check(result, target)
    return {"seconds": seconds, "processor": busy, "bytes": target.stat().st_size, "memory": grown}


def check(result: ws.Result, path: Path) -> None:
    """The file opens, and holds every robot and every frame."""
    from pxr import Usd

    stage = Usd.Stage.Open(str(path))
    robots = stage.GetPrimAtPath("/World/Robots").GetChildren()
    assert len(robots) == len(result)
    assert stage.GetEndTimeCode() == len(result.times) - 1
    moves = robots[-1].GetAttribute("xformOp:translate")
    assert moves.GetNumTimeSamples() == len(result.times)


def main() -> None:
    """Measure all cases, or, for a process of its own, one file."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--geometry", default="default", help="skel, points or mesh")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    parser.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    ws.quiet()
    if options.file:
        print(json.dumps(export(options.file, options.geometry)))
        return
    table = Table("export", "seconds", "processor s", "MB", "memory MB")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, (make, frames) in CASES.items():
            source = make(frames).save(Path(folder, "run.npz"))
            command = [sys.executable, __file__, "--file", source, "--geometry", options.geometry]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, env=os.environ)
            row = json.loads(done.stdout.splitlines()[-1])
            rows.append({"export": name, "geometry": options.geometry, **row})
            figures = (row["seconds"], row["processor"], row["bytes"] / 1e6, row["memory"] / 1e6)
            table.add_row(name, *(f"{figure:.1f}" for figure in figures))
    Console().print(table)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
