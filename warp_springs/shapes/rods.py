"""Long bodies: braced beams, chains of single springs, and snakes with cables."""

from __future__ import annotations

import numpy as np

from warp_springs.body.fields import require_positive, require_whole
from warp_springs.robot import Robot
from warp_springs.shapes.voxels import lattice

__all__ = ["beam", "chain", "snake"]


def beam(
    length: float = 1.0,
    width: float = 0.1,
    height: float = 0.1,
    cells: tuple[int, int, int] = (10, 1, 1),
    mass: float = 1.0,
    stiffness: float = 1000.0,
) -> Robot:
    """A braced beam along x: a lattice whose cells need not be cubes.

    Args:
        length: Along x [m].
        width: Along y [m].
        height: Along z [m].
        cells: Cells along x, y and z.
        mass: Of the whole body [kg], the same for each of its masses.
        stiffness: Of every spring [N/m].

    Returns:
        The beam, its lowest corner at the origin.

    Raises:
        ValueError: A parameter is out of range.
    """
    sizes = {"length": length, "width": width, "height": height}
    size = np.array([require_positive(name, value) for name, value in sizes.items()])
    counts = [require_whole(f"cells[{i}]", n, 1) for i, n in enumerate(_three(cells))]
    block = lattice(*counts, edge=1.0, stiffness=require_positive("stiffness", stiffness))
    return block.replace(
        masses=require_positive("mass", mass) / block.n_masses,
        positions=block.positions * (size / counts),
        rest_length=None,
    )


def chain(
    links: int = 10, length: float = 1.0, mass: float = 1.0, stiffness: float = 1000.0
) -> Robot:
    """Masses in a row along x, each joined to the next.

    Args:
        links: Number of springs.
        length: Of the whole chain [m].
        mass: Of the whole chain [kg], the same for each of its masses.
        stiffness: Of every spring [N/m]; the whole chain has stiffness / links.

    Returns:
        The chain on the ground, its first mass at the origin.

    Raises:
        ValueError: A parameter is out of range.
    """
    n = require_whole("links", links, 1)
    positions = np.zeros((n + 1, 3))
    positions[:, 0] = np.linspace(0.0, require_positive("length", length), n + 1)
    return Robot(
        masses=require_positive("mass", mass) / (n + 1),
        positions=positions,
        springs=np.stack([np.arange(n), np.arange(1, n + 1)], axis=1),
        stiffness=require_positive("stiffness", stiffness),
    )


def snake(
    segments: int = 8,
    edge: float = 0.1,
    span: int = 2,
    mass: float = 2.0,
    stiffness: float = 1000.0,
    cable: float = 2000.0,
) -> Robot:
    """A row of cubes along x that cables pull together along its four long edges.

    The cables are the last springs of the robot. Each joins two corners that are ``span`` cubes
    apart, and pulls only: shortened on one side, it bends the snake to that side.

    Args:
        segments: Number of cubes.
        edge: Of a cube [m].
        span: Cubes between the ends of a cable, at most ``segments``.
        mass: Of the whole body [kg].
        stiffness: Of the springs of the cubes [N/m].
        cable: Stiffness of the cables [N/m].

    Returns:
        The snake on the ground, its lowest corner at the origin.

    Raises:
        ValueError: A parameter is out of range.
    """
    n, reach = require_whole("segments", segments, 1), require_whole("span", span, 1)
    if reach > n:
        raise ValueError(f"span: got {reach}, expected at most segments = {n}")
    length = n * require_positive("edge", edge)
    body = beam(length, edge, edge, (n, 1, 1), mass, stiffness)
    # Along each long edge, the masses by their x.
    sides = np.argsort(np.rint(body.positions / edge) @ [1, 2 * n, 4 * n], kind="stable")
    sides = sides.reshape(4, n + 1)
    cables = np.stack([sides[:, :-reach], sides[:, reach:]], axis=-1).reshape(-1, 2)
    whole = Robot(
        masses=body.masses,
        positions=body.positions,
        springs=np.concatenate([body.springs, cables]),
        stiffness=np.append(body.stiffness, np.full(len(cables), require_positive("cable", cable))),
        faces=body.faces,
    )
    return whole.with_cables(np.arange(body.n_springs, whole.n_springs))


def _three(cells: tuple[int, int, int]) -> tuple[int, int, int]:
    try:
        x, y, z = cells
    except (TypeError, ValueError):
        raise ValueError(f"cells = {cells!r}: must be three counts, along x, y and z") from None
    return x, y, z
