"""The zoo of render.py drawn by PyVista, in an environment of its own: python render_peer.py DIR.

Reads DIR/scene.npz, writes DIR/MODE.png and prints one JSON line for each mode. Each picture is a
new pose: positions are updated, the meshes that follow from them are made again, and the pixels
are read back, as for a frame of a film.
"""

import json
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "1")  # the software OpenGL of Mesa: one thread

import numpy as np
import pyvista as pv

MODES = {
    "meshes, shadows, 8 x MSAA": {"tubes": True, "shadows": True},
    "meshes, 8 x MSAA": {"tubes": True, "shadows": False},
    "lines and points, 8 x MSAA": {"tubes": False, "shadows": False},
}
"""What is drawn: bars as tubes and masses as spheres, or both as VTK's shaded lines and points."""
SIDES = 12
FRAMES = 5


class Zoo:
    """A plotter with the zoo in it."""

    def __init__(self, scene, tubes: bool, shadows: bool):
        """Add everything, and draw once."""
        self.scene, self.tubes = scene, tubes
        width, height = (int(n) for n in scene["size"])
        self.plotter = pv.Plotter(off_screen=True, window_size=(width, height), lighting="none")
        self.plotter.set_background("#eef2f6")
        sun = pv.Light(position=scene["sun"] * 50, focal_point=(0, 0, 0), light_type="scene light")
        sky = pv.Light(position=(0, 0, 50), intensity=0.35, light_type="scene light")
        for light in (sun, sky):
            self.plotter.add_light(light)
        self._floor()
        self._bodies()
        eye, target = scene["eye"], scene["target"]
        self.plotter.camera.position, self.plotter.camera.focal_point = eye, target
        self.plotter.camera.up = (0, 0, 1)
        self.plotter.camera.view_angle = float(scene["angle"])
        if shadows:
            self.plotter.enable_shadows()
        self.plotter.enable_anti_aliasing("msaa", multi_samples=8)
        self.draw(scene["points"])

    def _floor(self):
        tile, n = float(self.scene["tile"]), 60
        floor = pv.Plane(i_size=n * tile, j_size=n * tile, i_resolution=n, j_resolution=n)
        floor.points[:, 2] = float(self.scene["floor"])
        checker = np.indices((n, n)).sum(axis=0).ravel() % 2
        floor.cell_data["c"] = np.where(checker[:, None], (214, 217, 222), (172, 178, 192)).astype(
            np.uint8
        )
        self.plotter.add_mesh(floor, scalars="c", rgb=True)

    def _bodies(self):
        scene, points = self.scene, self.scene["points"]
        faces = np.column_stack((np.full(len(scene["faces"]), 3), scene["faces"]))
        self.skin = pv.PolyData(points.copy(), faces.ravel())
        self.plotter.add_mesh(self.skin, color="#8ab4d4")
        self.lines = pv.PolyData()
        self.lines.points = points.copy()
        pairs = np.column_stack((np.full(len(scene["springs"]), 2), scene["springs"]))
        self.lines.lines = pairs.ravel()
        self.lines.cell_data["c"] = scene["colors"]
        self.dots = pv.PolyData(points.copy())
        if self.tubes:
            self.bars, self.balls = pv.PolyData(), pv.PolyData()
            self._meshes()
            self.plotter.add_mesh(self.bars, scalars="c", rgb=True, smooth_shading=True)
            self.plotter.add_mesh(self.balls, color="#1c1e21", smooth_shading=True)
        else:
            self.plotter.add_mesh(
                self.lines, scalars="c", rgb=True, render_lines_as_tubes=True, line_width=5
            )
            self.plotter.add_mesh(
                self.dots, color="#1c1e21", render_points_as_spheres=True, point_size=10
            )

    def _meshes(self):
        ball = pv.Sphere(float(self.scene["ball"]), theta_resolution=SIDES, phi_resolution=SIDES)
        tube = self.lines.tube(radius=float(self.scene["bar"]), n_sides=SIDES)
        self.bars.copy_from(tube)
        self.balls.copy_from(self.dots.glyph(geom=ball, scale=False, orient=False))

    def draw(self, points):
        """Return the picture of a pose."""
        for mesh in (self.skin, self.lines, self.dots):
            mesh.points = points
        if self.tubes:
            self._meshes()
        self.plotter.render()
        return self.plotter.screenshot(return_img=True)


def main() -> None:
    """Draw and time every mode."""
    folder = Path(sys.argv[1])
    scene = dict(np.load(folder / "scene.npz"))
    for name, mode in MODES.items():
        zoo = Zoo(scene, **mode)
        seconds = []
        for k in range(FRAMES):
            points = scene["points"] * (1.0, 1.0, 1.0 + 1e-3 * k)
            start, busy = time.perf_counter(), time.process_time()
            picture = zoo.draw(points)
            seconds.append((time.perf_counter() - start, time.process_time() - busy))
        zoo.plotter.close()
        path = folder / f"pyvista_{list(MODES).index(name)}.png"
        _save(picture, path)
        print(json.dumps({"mode": name, "seconds": seconds, "picture": str(path)}), flush=True)


def _save(picture, path: Path) -> None:
    from matplotlib.image import imsave

    imsave(path, picture)


if __name__ == "__main__":
    main()
