"""Long bodies: braced beams, and chains of single springs."""

from __future__ import annotations

import numpy as np

from warp_springs.body.fields import require_positive, require_whole
from warp_springs.robot import Robot
from warp_springs.shapes.voxels import lattice

__all__ = ["beam", "chain"]


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


def _three(cells: tuple[int, int, int]) -> tuple[int, int, int]:
    try:
        x, y, z = cells
    except (TypeError, ValueError):
        raise ValueError(f"cells = {cells!r}: must be three counts, along x, y and z") from None
    return x, y, z
