"""Shapes: bodies to start from, each a `Robot` that stands on the ground z = 0.

All are at rest and not actuated, and their springs have their initial lengths.
"""

from warp_springs.shapes.convex import octahedron, tetrahedron
from warp_springs.shapes.cut import Cut
from warp_springs.shapes.filled import filled, sphere
from warp_springs.shapes.rods import beam, chain, snake
from warp_springs.shapes.scattered import random_lattice
from warp_springs.shapes.voxels import cube, lattice, voxels

__all__ = [
    "Cut",
    "beam",
    "chain",
    "cube",
    "filled",
    "lattice",
    "octahedron",
    "random_lattice",
    "snake",
    "sphere",
    "tetrahedron",
    "voxels",
]
