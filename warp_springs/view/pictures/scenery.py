"""From actors to a drawing: bodies, forces, obstacles and the floor at one moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_springs.scene import Scene
from warp_springs.view import appearance
from warp_springs.view.look import Look
from warp_springs.view.pictures.actors import Actor, FloatArray
from warp_springs.view.pictures.props import NEAR, Pieces, add_forces, add_obstacles, is_near
from warp_springs.view.pictures.rasteriser import Drawing

_ENDLESS = 8.0
"""Half the side of what is drawn of endless things, in sizes of what is shown."""


def draw_scene(actors: Sequence[Actor], scene: Scene, look: Look, time: float) -> Drawing:
    """Return everything that is to be seen at a time [s].

    The floor lies below z = 0 by the radius of the largest sphere, so that spheres rest on it.

    Args:
        actors: The robots at their places.
        scene: Their world; each place has its own.
        look: What is drawn of them.
        time: s.
    """
    pieces = Pieces()
    largest = max(a.ball for a in actors)
    poses = [a.positions(time) for a in actors]
    for actor, positions in zip(actors, poses, strict=True):
        _add_body(pieces, actor, positions, time, look)
        add_forces(pieces, actor.body, positions, actor.offset, time)
    sizes = [float(np.linalg.norm(a.high[0] - a.low[0])) for a in actors]
    tile = appearance.tile_size(sizes)
    for casting in (True, False):
        for offset in _places(actors):
            there = [p for a, p in zip(actors, poses, strict=True) if (a.offset == offset).all()]
            box = np.concatenate(there)
            low, high = box.min(axis=0) - offset, box.max(axis=0) - offset
            size = max(float(np.linalg.norm(high - low)), *sizes)
            around = (low + high) / 2
            chosen = [o for o in scene.obstacles if is_near(o, around, NEAR * size) == casting]
            add_obstacles(pieces, chosen, around, _ENDLESS * size, tile, largest, offset)
        if casting:
            pieces.end_of_casters()
    floor = None if scene.ground is None else -largest
    water = None if scene.water is None else scene.water.level
    return pieces.drawing(floor=floor, tile=tile, water=water)


def _add_body(pieces: Pieces, actor: Actor, positions: FloatArray, time: float, look: Look) -> None:
    body = actor.body
    first = pieces.points(positions)
    if look.skin_color is not None:
        pieces.triangles(first + body.faces, look.skin_color)
    if look.bars:
        whole = actor.holding(time)
        pieces.bars(first + body.springs[whole], actor.bar, actor.colors(time)[whole])
    if look.balls:
        color = np.tile(np.float32(appearance.MASS), (body.n_masses, 1))
        color[body.elements.bonds.masses] = appearance.HELD
        pieces.balls(first + np.arange(body.n_masses), actor.ball, color)


def _places(actors: Sequence[Actor]) -> FloatArray:
    """The different places of actors, (P, 3) m: robots of one world share one."""
    return np.unique([a.offset for a in actors], axis=0)
