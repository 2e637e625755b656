"""Where the robots of a picture stand, and where the camera stands and looks at any time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_springs.io.usd.layout import placed
from warp_springs.scene import Scene
from warp_springs.view.look import Cut, Look
from warp_springs.view.pictures.actors import Actor, FloatArray
from warp_springs.view.pictures.camera import Camera
from warp_springs.view.pictures.props import NEAR, corners_near

_VIEW_OF_ONE = {"azimuth": -58.0, "elevation": 25.0, "margin": 1.6}
_VIEW_OF_MANY = {"azimuth": -77.0, "elevation": 37.0, "margin": 1.1}
_VIEW_OF_TILE = {"azimuth": -58.0, "elevation": 25.0, "margin": 1.45}
_MARGIN_OF_PROPS = 1.15
_SAMPLES = 40
_RING = 24


@dataclass(frozen=True)
class Setting:
    """What all shots of a film have in common.

    Attributes:
        times: The times that are shown [s], (K,).
        scene: The world.
        look: How it is drawn; its azimuth, elevation and camera are kept where they are given.
        cut: Whether the camera follows and turns.
    """

    times: FloatArray
    scene: Scene
    look: Look
    cut: Cut


class Director:
    """Decides on the camera at any time: it follows the robots calmly, and may walk around them."""

    def __init__(
        self,
        actors: Sequence[Actor],
        setting: Setting,
        size: tuple[int, int],
        *,
        tile: bool = False,
    ):
        """Look through the whole film once.

        Args:
            actors: At their places.
            setting: With a floor the camera keeps its height; obstacles nearby are shown.
            size: Of the picture in pixels.
            tile: Whether the picture is one of several in a panel.
        """
        times, scene, look, cut = setting.times, setting.scene, setting.look, setting.cut
        self._actors, self._size, self._look, self._turns = actors, size, look, cut.turns
        self._times = actors[0].times
        way = np.mean([a.calm_way + a.offset for a in actors], axis=0)
        if scene.ground is not None:
            way[:, 2] = 0.0
        self._way = way
        if not cut.follow:
            self._way = np.tile(self.way(times[0]), (len(way), 1))
        view = _VIEW_OF_TILE if tile else _VIEW_OF_ONE if len(actors) == 1 else _VIEW_OF_MANY
        self._view = dict(view)
        if len(times) > 1:  # room for all its poses is room enough for each
            self._view["margin"] = 1.0 + 0.4 * (view["margin"] - 1.0)
        if look.azimuth is not None:
            self._view["azimuth"] = look.azimuth
        if look.elevation is not None:
            self._view["elevation"] = look.elevation
        self._start = float(times[0])
        steps = np.unique(np.linspace(0, len(times) - 1, _SAMPLES).astype(int))
        self._points, self._radius = self._seen_around_the_way(times[steps], scene)

    def way(self, time: float) -> FloatArray:
        """Return the place that the camera follows [m], (3,)."""
        return np.array([np.interp(time, self._times, self._way[:, axis]) for axis in range(3)])

    def camera(self, time: float, share: float = 0.0) -> Camera:
        """Return the camera at a time [s], after a share 0 ... 1 of the film."""
        turn = 360.0 * self._turns * share
        if self._look.camera is not None:
            return _moved(self._look.camera, self.way(time) - self.way(self._start), turn)
        view = {**self._view, "azimuth": self._view["azimuth"] + turn}
        points = _turned(self._points, turn) if self._turns else self._points
        camera = Camera.framing(points, self._size, radius=self._radius, **view)
        return _moved(camera, self.way(time), 0.0)

    def stand_back(self, factor: float) -> None:
        """Leave more room around the robots."""
        self._view["margin"] *= factor

    def _seen_around_the_way(self, times: FloatArray, scene: Scene) -> tuple[FloatArray, float]:
        """Return what is to be seen, (P, 3) m from what the camera follows, and its margin [m]."""
        points, props = [], []
        for actor in self._actors:
            reach = NEAR * actor.body.diameter if scene.obstacles else 0.0
            for time in times:
                points.append(actor.positions(time) - self.way(time))
                place = actor.way(time) - actor.offset
                corners = corners_near(scene.obstacles, place, reach)
                props.append(corners + actor.offset - self.way(time))
        if sum(map(len, props)):
            self._view["margin"] = min(self._view["margin"], _MARGIN_OF_PROPS)
        points, radius = np.concatenate(points + props), max(a.ball for a in self._actors)
        if not self._turns:
            return points, radius
        # seen from all sides alike: a cylinder around what is turned about
        reach = float(np.linalg.norm(points[:, :2], axis=1).max())
        angle = np.arange(_RING) * (2 * math.pi / _RING)
        ring = np.column_stack((reach * np.cos(angle), reach * np.sin(angle)))
        heights = points[:, 2].min(), points[:, 2].max()
        ring = np.concatenate([np.column_stack((ring, np.full(_RING, z))) for z in heights])
        return ring, radius


def put_on_grid(actors: Sequence[Actor]) -> FloatArray:
    """Move robots onto a square grid, far enough apart for all their motion.

    Returns:
        The middles of the cells, (R, 3) m, for `spread`.
    """
    offsets = placed(actors, None)
    largest = max(a.ball for a in actors)
    offsets[:, 2] += [a.ball - largest for a in actors]
    for actor, offset in zip(actors, offsets, strict=True):
        actor.offset = offset
    return np.array([(a.low[0] + a.high[0]) / 2 + a.offset for a in actors]) * (1, 1, 0)


def spread(actors: Sequence[Actor], cells: FloatArray, factor: float) -> None:
    """Move robots on a grid apart, to cells (R, 3) m farther out by a factor."""
    for actor, cell in zip(actors, cells, strict=True):
        start = (actor.low[0] + actor.high[0]) / 2 * (1, 1, 0)
        actor.offset = factor * cell - start + (0, 0, actor.offset[2])


def _moved(camera: Camera, offset: FloatArray, turn: float) -> Camera:
    """Return a camera moved by an offset [m] and turned around its target [degrees]."""
    target = np.add(camera.target, offset)
    eye = target + _turned(np.subtract(camera.eye, camera.target)[None], turn)[0]
    return Camera(tuple(eye), tuple(target), camera.field_of_view)


def _turned(points: FloatArray, degrees: float) -> FloatArray:
    """Return points (P, 3) turned about the vertical through the origin."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
