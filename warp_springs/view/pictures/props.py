"""What a picture shows besides bodies: obstacles, water, arrows of forces, tethers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_springs.robot import Robot
from warp_springs.surfaces import Box, HeightField, Plane, Sphere
from warp_springs.view import appearance
from warp_springs.view.pictures.camera import view_axes
from warp_springs.view.pictures.rasteriser import Drawing
from warp_springs.view.pictures.solids import grid_mesh, obstacle_mesh

FloatArray = NDArray[np.float64]

Obstacle = Plane | Sphere | Box | HeightField

NEAR = 3.0
"""How far away obstacles are shown and throw shadows, in sizes of the robots."""

_NOWHERE = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
_TILES, _MOST_TILES = 12, 60
_ARROW_SIDES = 20
_LONGEST_ARROW = 0.55
_SHORTEST_ARROW = 0.2


class Pieces:
    """Points, triangles, bars and balls, collected one after the other into one `Drawing`.

    Attributes:
        origin: What is added to points that are given from now on [m], (3,).
    """

    def __init__(self) -> None:
        self.origin = np.zeros(3)
        self._points: list[FloatArray] = []
        self._count = 0
        self._triangles: list[tuple[NDArray, NDArray]] = []
        self._bars: list[tuple[NDArray, NDArray, NDArray]] = []
        self._balls: list[tuple[NDArray, NDArray, NDArray]] = []
        self._casters: int | None = None

    def points(self, points: ArrayLike) -> int:
        """Add points, (P, 3) m, and return the index of the first."""
        first, points = self._count, np.asarray(points, dtype=np.float64)
        self._points.append(points + self.origin)
        self._count += len(points)
        return first

    def triangles(self, corners: ArrayLike, color: ArrayLike) -> None:
        """Add triangles, (T, 3) indices of points, of one colour or of (T, 3) colours."""
        corners = np.asarray(corners, np.int32).reshape(-1, 3)
        self._triangles.append((corners, _rows(color, len(corners), 3)))

    def bars(self, ends: ArrayLike, radius: ArrayLike, color: ArrayLike) -> None:
        """Add cylinders between pairs of points, (B, 2) indices."""
        ends = np.asarray(ends, np.int32).reshape(-1, 2)
        self._bars.append((ends, _rows(radius, len(ends)), _rows(color, len(ends), 3)))

    def balls(self, centers: ArrayLike, radius: ArrayLike, color: ArrayLike) -> None:
        """Add spheres around points, (K,) indices."""
        centers = np.asarray(centers, np.int32).reshape(-1)
        self._balls.append((centers, _rows(radius, len(centers)), _rows(color, len(centers), 3)))

    def end_of_casters(self) -> None:
        """Say that what is added from now on need not be in the map of shadows."""
        self._casters = self._count

    def drawing(self, **given: float | None) -> Drawing:
        """Return everything as one drawing; what is given are further fields of it."""
        given["casters"] = self._casters
        for names, parts in (
            (("triangles", "triangle_color"), self._triangles),
            (("bars", "bar_radius", "bar_color"), self._bars),
            (("balls", "ball_radius", "ball_color"), self._balls),
        ):
            if parts:
                columns = zip(*parts, strict=True)
                given |= {n: np.concatenate(c) for n, c in zip(names, columns, strict=True)}
        return Drawing(points=np.concatenate(self._points), **given)


def add_obstacles(
    pieces: Pieces,
    obstacles: Iterable[Obstacle],
    around: FloatArray,
    reach: float,
    tile: float,
    sink: float,
    offset: FloatArray,
) -> None:
    """Add obstacles of a scene.

    Args:
        pieces: Where to.
        obstacles: Which.
        around: Middle of the robots in their own world [m], (3,): of what has no end only this
            part is drawn.
        reach: How far around it they are drawn [m].
        tile: Edge of the tiles of their checker [m].
        sink: How far surfaces are drawn below where masses stop [m], as the floor is: the radius
            of the spheres that stand for masses, which then rest on them.
        offset: How far this world is moved to its place in the picture [m], (3,).
    """
    pieces.origin = offset
    for obstacle in obstacles:
        if isinstance(obstacle, Sphere):
            first = pieces.points([np.subtract(obstacle.center, (0.0, 0.0, sink))])
            pieces.balls([first], obstacle.radius, appearance.OBSTACLE)
        elif isinstance(obstacle, Box):
            _add_box(pieces, obstacle, sink)
        elif isinstance(obstacle, Plane):
            _add_plane(pieces, obstacle, around, reach, tile, sink)
        elif isinstance(obstacle, HeightField):
            _add_heights(pieces, obstacle, sink)
    pieces.origin = np.zeros(3)


def corners_near(obstacles: Iterable[Obstacle], around: FloatArray, reach: float) -> FloatArray:
    """Return the corners of boxes around the spheres and boxes near a point, (8 K, 3) m.

    Args:
        obstacles: Of a scene.
        around: The point [m], (3,).
        reach: What is larger or farther away than this is left out [m].
    """
    found = [np.zeros((0, 3))]
    for obstacle in obstacles:
        if not is_near(obstacle, around, reach):
            continue
        if isinstance(obstacle, Sphere):
            obstacle = Box(center=obstacle.center, size=(2.0 * obstacle.radius,) * 3)
        found.append(obstacle_mesh(obstacle, _NOWHERE)[0])
    return np.concatenate(found)


def is_near(obstacle: Obstacle, around: FloatArray, reach: float) -> bool:
    """Whether an obstacle is a sphere or a box that is smaller than a reach [m] and within it."""
    if isinstance(obstacle, Sphere):
        size = obstacle.radius
    elif isinstance(obstacle, Box):
        size = float(np.linalg.norm(obstacle.size)) / 2
    else:
        return False
    return size < reach and float(np.linalg.norm(np.subtract(obstacle.center, around))) < reach


def add_forces(
    pieces: Pieces, body: Robot, positions: FloatArray, offset: FloatArray, time: float
) -> None:
    """Add an arrow for each external force that acts now, and a thin line for each tether.

    The strongest force that the robot ever feels has an arrow of half its diameter.

    Args:
        pieces: Where to.
        body: The robot.
        positions: Its masses in the picture [m], (M, 3).
        offset: How far it is moved to its place in the picture [m], (3,).
        time: Now [s].
    """
    pushes, tethers = body.elements.pushes, body.elements.tethers
    if not pushes and not tethers:
        return
    bar, ball = appearance.drawn_radii(body.lengths)
    strongest = max((float(np.linalg.norm(p.force)) for p in pushes), default=0.0)
    for push in pushes:
        force = np.array(push.force)
        size = float(np.linalg.norm(force))
        if push.start <= time < push.end and size > 0.0:
            share = max(_LONGEST_ARROW * size / strongest, _SHORTEST_ARROW)
            way = force / size * share * body.diameter
            for mass in push.masses:
                start = positions[mass] + force / size * ball
                _add_arrow(pieces, start, start + way, bar, appearance.PUSH)
    for tether in tethers:
        if tether.start <= time < tether.end:
            first = pieces.points([positions[tether.mass], np.add(tether.point, offset)])
            pieces.bars([(first, first + 1)], 0.35 * bar, appearance.PUSH)
            pieces.balls([first + 1], 0.6 * ball, appearance.PUSH)


def _add_arrow(
    pieces: Pieces, start: FloatArray, tip: FloatArray, radius: float, color: Sequence[float]
) -> None:
    """Add a shaft with a cone at its tip."""
    way = tip - start
    length = float(np.linalg.norm(way))
    right, down, forward = view_axes(way)
    head = min(6.5 * radius, 0.5 * length)
    neck = tip - head * forward
    first = pieces.points([start, neck])
    pieces.bars([(first, first + 1)], radius, color)
    pieces.balls([first], radius, color)
    angle = np.arange(_ARROW_SIDES) * (2 * np.pi / _ARROW_SIDES)
    rim = neck + 2.4 * radius * (np.outer(np.cos(angle), right) + np.outer(np.sin(angle), down))
    first = pieces.points(np.concatenate((rim, [tip, neck])))
    here = np.arange(_ARROW_SIDES)
    there = (here + 1) % _ARROW_SIDES
    for end in (_ARROW_SIDES, _ARROW_SIDES + 1):
        ends = np.full(_ARROW_SIDES, end)
        pieces.triangles(first + np.column_stack((here, there, ends)), color)


def _add_box(pieces: Pieces, box: Box, sink: float) -> None:
    size = np.maximum(np.array(box.size) - (2 * sink, 2 * sink, 0.0), 1e-9)
    center = np.array(box.center) - sink * box.rotation[:, 2]
    points, corners = obstacle_mesh(replace(box, size=size, center=center), _NOWHERE)
    pieces.triangles(pieces.points(points) + corners, appearance.OBSTACLE)


def _add_plane(
    pieces: Pieces, plane: Plane, around: FloatArray, reach: float, tile: float, sink: float
) -> None:
    """Add the part of a plane near the robots, tiled in its own directions."""
    normal = np.array(plane.normal)
    right, down, _ = view_axes(-normal)
    foot = around + (plane.offset - sink - around @ normal) * normal
    n = min(2 * max(_TILES, int(np.ceil(reach / tile))), _MOST_TILES)
    points, corners = grid_mesh(n + 1, n + 1)
    steps = (points[:, :2] - n / 2) * (2 * reach / n)
    first = pieces.points(foot + steps[:, :1] * right - steps[:, 1:] * down)
    _add_tiles(pieces, first + corners, (n + 1, n + 1))


def _add_heights(pieces: Pieces, field: HeightField, sink: float) -> None:
    points, corners = obstacle_mesh(field, _NOWHERE)
    first = pieces.points(points - (0.0, 0.0, sink))
    _add_tiles(pieces, first + corners, field.heights.shape)


def _add_tiles(pieces: Pieces, corners: NDArray, shape: tuple[int, int]) -> None:
    """Add triangles of a grid of points of a shape, first one half of all tiles, then the other."""
    tiles = np.add.outer(*(np.arange(n - 1) for n in shape)).ravel() % 2
    color = np.where(tiles[:, None] == 1, appearance.OBSTACLE_DARK, appearance.OBSTACLE)
    pieces.triangles(corners, np.tile(color, (2, 1)))


def _rows(values: ArrayLike, count: int, width: int | None = None) -> NDArray[np.float32]:
    """One row for each of `count` things, from one for all or from all of them."""
    shape = (count,) if width is None else (count, width)
    return np.broadcast_to(np.asarray(values, np.float32), shape)
