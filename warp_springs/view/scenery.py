"""From actors to a drawing: bodies, forces, obstacles and the floor at one moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_springs.scene import Scene
from warp_springs.view import appearance
from warp_springs.view.actors import Actor, FloatArray
from warp_springs.view.look import Look
from warp_springs.view.props import Pieces, add_forces, add_obstacles
from warp_springs.view.rasteriser import Drawing

_ENDLESS = 3.0
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
    pieces.end_of_casters()
    sizes = [float(np.linalg.norm(a.high[0] - a.low[0])) for a in actors]
    tile = appearance.tile_size(sizes)
    if scene.obstacles or scene.water is not None:
        for offset in _places(actors):
            there = [p for a, p in zip(actors, poses, strict=True) if (a.offset == offset).all()]
            box = np.concatenate(there)
            low, high = box.min(axis=0), box.max(axis=0)
            reach = max(_ENDLESS * float(np.linalg.norm(high - low)), _ENDLESS * max(sizes))
            around = (low + high) / 2 - offset
            add_obstacles(pieces, scene, around, reach, tile, largest, offset)
    floor = None if scene.ground is None else -largest
    return pieces.drawing(floor, tile)


def _add_body(pieces: Pieces, actor: Actor, positions: FloatArray, time: float, look: Look) -> None:
    body = actor.body
    first = pieces.points(positions)
    if look.skin_color is not None:
        pieces.triangles(first + body.faces, look.skin_color)
    if look.bars:
        pieces.bars(first + body.springs, actor.bar, actor.colors(time))
    if look.balls:
        color = np.tile(np.float32(appearance.MASS), (body.n_masses, 1))
        color[body.elements.bonds.masses] = appearance.HELD
        pieces.balls(first + np.arange(body.n_masses), actor.ball, color)


def _places(actors: Sequence[Actor]) -> FloatArray:
    """The different places of actors, (P, 3) m: robots of one world share one."""
    return np.unique([a.offset for a in actors], axis=0)
