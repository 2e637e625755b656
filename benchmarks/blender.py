"""Animations in Blender: they open, play true to the simulation, and are looked at.

    python benchmarks/blender.py [--out DIR] [--blender PYTHON]

Blender 5.0.1 comes from PyPI as the package ``bpy``, into an environment of its own, made once and
kept in benchmarks/peers/.cache (1 GB). It exists for Python 3.11 alone: under another, name an
interpreter that has it, ``python3.11 -m venv blender && blender/bin/pip install bpy==5.0.1``.

For every geometry a walking robot and a tumbling cube are exported, opened there, and the centres
of the balls that Blender draws are compared with the simulated masses in several frames (of points,
the points themselves). Pictures of the middle of each animation are written to DIR, by Cycles on
the CPU, as ``skel.png``, ``points.png``, ``mesh.png`` and ``material.png``.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from peers.environments import python_of

FRAMES = (0, 11, 23, 45)
CASES = {
    "skel": {},
    "points": {"geometry": "points"},
    "mesh": {"geometry": "mesh"},
    "material": {"color": "material"},
}
TOLERANCE = 5e-5


def make(folder: Path) -> None:
    """Export everything, with the positions that are expected beside it."""
    import warp_springs as ws

    ws.quiet()
    body = ws.shapes.lattice(4, 1, 1, stiffness=3000.0).moved((0.0, 0.0, 0.02))
    wave = 12.0 * body.positions[body.springs].mean(axis=1)[:, 0]
    walker = body.made_of(ws.materials.TISSUE).made_of(ws.materials.MUSCLE, where=wave > 2.5)
    walker = walker.replace(amplitude=0.12 * body.rest_length, phase=wave, omega=9.0)
    cube = ws.shapes.cube().moved((0.0, 0.5, 0.3)).rotated((1, 2, 3), 0.7).spinning((3, -2, 4))
    result = ws.Simulation([walker, cube], ws.Scene(damping=0.3)).run(1.5, fps=30)
    for name, options in CASES.items():
        ws.export_usd(result, folder / f"{name}.usdc", grid=False, **options)
    expected = [[result.frames(i)[frame].tolist() for frame in FRAMES] for i in range(2)]
    (folder / "expected.json").write_text(json.dumps(expected))


def look(folder: Path, out: Path) -> None:
    """Inside Blender: open each file, compare, and draw."""
    import bpy

    expected = json.loads((folder / "expected.json").read_text())
    for name in CASES:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.context.scene.world = bpy.data.worlds.new("Sky")  # takes what the DomeLight says
        bpy.ops.wm.usd_import(filepath=str(folder / f"{name}.usdc"), import_guide=False)
        worst = 0.0
        for robot, frames in enumerate(expected):
            for frame, masses in zip(FRAMES, frames, strict=True):
                bpy.context.scene.frame_set(frame)
                places = drawn(bpy, f"robot_{robot:04d}_masses", len(masses))
                worst = max(worst, float(np.abs(places - masses).max()))
        print(f"{name:9s} largest distance from the simulation {worst:.1e} m", flush=True)
        if worst > TOLERANCE:
            sys.exit(f"{name}: Blender shows masses {worst:.1e} m from where they were simulated")
        picture(bpy, out / f"{name}.png")


def drawn(bpy, name: str, masses: int) -> np.ndarray:
    """Where Blender draws the masses of a robot in this frame, (M, 3)."""
    graph = bpy.context.evaluated_depsgraph_get()
    thing = bpy.data.objects[name].evaluated_get(graph)
    data = thing.data
    places = np.zeros(3 * len(data.attributes["position"].data))
    data.attributes["position"].data.foreach_get("vector", places)
    matrix = np.array(thing.matrix_world)
    world = places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    return world.reshape(masses, -1, 3).mean(axis=1)  # a ball's points follow each other


def picture(bpy, path: Path) -> None:
    """Draw the middle of the animation with the file's own camera and lights."""
    scene = bpy.context.scene
    scene.frame_set(FRAMES[2])
    scene.camera = bpy.data.objects["Camera"]
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 24
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    scene.view_settings.view_transform = "Standard"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def own_blender() -> Path:
    """The interpreter of an environment with bpy, which is made if it is not there."""
    try:
        return python_of("blender")
    except RuntimeError as error:
        own = f"{sys.version_info[0]}.{sys.version_info[1]}"
        sys.exit(
            f"bpy 5.0.1 cannot be installed for this Python {own} ({error}); it exists for 3.11: "
            "give --blender PYTHON, one that has it (see the top of this file)"
        )


def main() -> None:
    """Make the files here, and look at them there."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--blender", type=Path, help="a Python that has bpy; default: made here")
    parser.add_argument("--out", type=Path, default=Path("out"), help="where pictures are written")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.inside:
        look(options.inside, options.out.resolve())
        return
    blender = options.blender or own_blender()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        make(Path(folder))
        command = [blender, __file__, "--inside", folder, "--out", options.out]
        sys.exit(subprocess.run(command, check=False).returncode)


if __name__ == "__main__":
    main()
