"""Solid bodies inside closed surfaces: the skin's own masses, and a lattice within."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.fields import require_positive, require_whole
from warp_springs.geometry import FloatArray
from warp_springs.robot import Robot
from warp_springs.shapes.points import pairs_within, scattered_points
from warp_springs.shapes.surface import (
    IndexArray,
    closed_surface,
    components,
    distinct_edges,
    inside,
    sphere_surface,
    vertex_normals,
)

__all__ = ["filled", "sphere"]

_CLEARANCE = 0.6
"""No mass inside is closer to one of the skin than so many spacings; to a triangle, half that."""
_SLOPE = 0.25
"""Least sine of the angle between a brace and the skin that it starts from."""


def filled(
    surface: Robot | Sequence[ArrayLike],
    spacing: float,
    *,
    seed: int | None = None,
    reach: float = 1.8,
    mass: float = 1.0,
    stiffness: float = 1000.0,
) -> Robot:
    """A closed surface filled with a lattice: mesh in, solid body out.

    The vertices of the surface are the first masses, its edges the first springs, its triangles
    the faces. Inside stands a cubic lattice of masses, or random ones with a seed. Springs join
    masses within reach as long as they stay inside the body, so limbs that lie close together are
    not tied to each other.

    ``ws.shapes.filled(ws.read_mesh("bunny.stl"), spacing=0.01)``

    Args:
        surface: A robot with faces, such as `read_mesh` returns, or (positions, faces). Repeated
            vertices are welded. It must be closed.
        spacing: Distance [m] of the masses inside, least distance if they are random.
        seed: From which random places follow; a cubic lattice when left out.
        reach: Longest spring from or to the inside, in spacings, at least 1.
        mass: Of the whole body [kg], the same for each of its masses.
        stiffness: Of every spring [N/m].

    Returns:
        The body where the surface was.

    Raises:
        ValueError: A parameter is out of range, the surface is not closed, or the spacing is so
            coarse that the body would fall apart.
    """
    spacing = require_positive("spacing", spacing)
    if not (np.isfinite(reach) and reach >= 1.0):
        raise ValueError(f"reach = {reach!r}: must be a number of spacings, at least 1")
    pair = (surface.positions, surface.faces) if isinstance(surface, Robot) else surface
    skin, faces = closed_surface(*(np.asarray(part) for part in pair))
    within = _interior(skin, faces, spacing, seed)
    positions = np.concatenate([skin, within])
    edges = distinct_edges(faces)
    braces = _braces(positions, skin, faces, reach * spacing)
    springs = np.unique(np.concatenate([edges, braces]), axis=0)
    if components(len(positions), springs) > components(len(skin), edges):
        raise ValueError(
            f"spacing = {spacing:g}: too coarse for this surface, the body would fall apart"
        )
    return Robot(
        masses=require_positive("mass", mass) / len(positions),
        positions=positions,
        springs=springs,
        stiffness=require_positive("stiffness", stiffness),
        faces=faces,
    )


def sphere(
    radius: float = 0.1, subdivisions: int = 2, mass: float = 1.0, stiffness: float = 1000.0
) -> Robot:
    """A solid ball: an icosahedron refined so many times, and filled at the pitch of its edges.

    Args:
        radius: Of the vertices of the skin [m].
        subdivisions: How often each triangle of the icosahedron is quartered, 0 to 6.
        mass: Of the whole body [kg], the same for each of its masses.
        stiffness: Of every spring [N/m].

    Returns:
        The ball, its lowest mass above the origin on the ground.

    Raises:
        ValueError: A parameter is out of range.
    """
    radius = require_positive("radius", radius)
    if require_whole("subdivisions", subdivisions, 0) > 6:
        raise ValueError(f"subdivisions = {subdivisions}: at most 6 (81,920 triangles)")
    skin, faces = sphere_surface(radius, subdivisions)
    edge = float(np.linalg.norm(np.diff(skin[distinct_edges(faces)], axis=1), axis=2).mean())
    skin[:, 2] -= skin[:, 2].min()
    return filled((skin, faces), edge, mass=mass, stiffness=stiffness)


def _interior(skin: FloatArray, faces: IndexArray, spacing: float, seed: int | None) -> FloatArray:
    """The masses inside a surface, not too close to those of the skin."""
    low, high = skin.min(axis=0), skin.max(axis=0)
    if seed is None:
        # A lattice with a mass, or the middle of a cell, at the centre: symmetric bodies stay so.
        counts = np.maximum(np.ceil((high - low) / spacing - 1e-9).astype(np.intp) - 1, 1)
        steps = [spacing * (np.arange(n) - (n - 1) / 2) for n in counts]
        points = np.array(list(itertools.product(*steps))) + (low + high) / 2
    else:
        rng = np.random.default_rng(require_whole("seed", seed, 0))
        points = scattered_points(low, high, spacing, rng)
    clearance = _CLEARANCE / 2.0 * spacing * np.concatenate([np.eye(3), -np.eye(3)])
    for offset in (np.zeros(3), *clearance):
        points = points[inside(points + offset, skin, faces)]
    everything = np.concatenate([skin, points])
    close = pairs_within(everything, _CLEARANCE * spacing)
    crowded = close[(close[:, 0] < len(skin)) & (close[:, 1] >= len(skin)), 1]
    return np.delete(points, crowded - len(skin), axis=0)


def _braces(positions: FloatArray, skin: FloatArray, faces: IndexArray, reach: float) -> IndexArray:
    """Springs between masses within reach that run through the inside of the body."""
    pairs = pairs_within(positions, reach)
    direction = positions[pairs[:, 1]] - positions[pairs[:, 0]]
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
    normals = np.zeros_like(positions)
    normals[: len(skin)] = vertex_normals(skin, faces)
    # A brace leaves the skin inwards; from the masses inside it may go anywhere.
    good = np.ones(len(pairs), bool)
    for end, sign in ((0, 1.0), (1, -1.0)):
        sine = sign * np.einsum("ij,ij->i", direction, normals[pairs[:, end]])
        good &= (pairs[:, end] >= len(skin)) | (sine < -_SLOPE)
    pairs = pairs[good]
    for share in (0.25, 0.5, 0.75):
        ends = positions[pairs]
        pairs = pairs[inside((1.0 - share) * ends[:, 0] + share * ends[:, 1], skin, faces)]
    return pairs
