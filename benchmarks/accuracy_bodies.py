"""The robots of the accuracy benchmark."""

from __future__ import annotations

import numpy as np

import warp_springs as ws

__all__ = [
    "G",
    "breathing_cube",
    "breathing_lattice",
    "cantilever",
    "inchworm",
    "pair",
    "plate",
    "slinky",
    "tumbling_cube",
]

#: Gravity [m/s^2].
G = 9.81


def pair() -> ws.Robot:
    """Two masses on a stretched spring, 177 rad/s."""
    return ws.Robot(
        masses=[0.1, 0.3],
        positions=[(0.0, 0.0, 0.0), (0.21, 0.0, 0.0)],
        springs=[(0, 1)],
        stiffness=1000.0,
        rest_length=0.2,
    )


def tumbling_cube() -> ws.Robot:
    """The classroom's cube, turned on a corner, spinning."""
    cube = ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1000.0)
    cube = cube.moved(-cube.center_of_mass).rotated((1, 2, 3), 0.7)
    return cube.moved((0.0, 0.0, 0.3)).spinning((3.0, -2.0, 4.0))


def breathing_lattice() -> ws.Robot:
    """Two voxels, every spring breathing by 5 %, spinning, turned to land on a corner."""
    body = ws.shapes.lattice(2, 1, 1, edge=0.1, mass_per_vertex=0.1, stiffness=1500.0)
    axis = np.array([0.4, -0.9, 0.3])
    body = body.moved(-body.center_of_mass).rotated(axis, np.linalg.norm(axis))
    body = body.moved((0.0, 0.0, 0.33)).spinning((2.0, 3.0, -1.5)).moving((0.4, 0.0, 0.0))
    phase = np.linspace(0.0, 6.0, body.n_springs)
    return body.replace(amplitude=0.05 * body.rest_length, phase=phase, omega=8.0)


def slinky() -> ws.Robot:
    """A chain of 12 masses as it hangs from its top, at the moment it is let go."""
    n, mass, stiffness, length = 12, 0.05, 500.0, 0.05
    below = mass * G * np.arange(n - 1, 0, -1)  # weight that each spring carries
    heights = -np.concatenate([[0.0], np.cumsum(length + below / stiffness)])
    return ws.Robot(
        masses=np.full(n, mass),
        positions=np.stack([0 * heights, 0 * heights, heights], axis=1),
        springs=np.stack([np.arange(n - 1), np.arange(1, n)], axis=1),
        stiffness=stiffness,
        rest_length=length,
    )


def plate() -> ws.Robot:
    """A square of four masses lying on the ground, sliding at 1 m/s: nothing in it deforms."""
    depth, mass = 0.1 * G / 1e5, 0.1
    corners = [(0, 0, -depth), (0.1, 0, -depth), (0.1, 0.1, -depth), (0, 0.1, -depth)]
    edges = [(0, 1), (1, 2), (2, 3), (0, 3), (0, 2), (1, 3)]
    body = ws.Robot(masses=[mass] * 4, positions=corners, springs=edges, stiffness=2000.0)
    return body.moving((0.6, 0.8, 0.0))


def cantilever() -> ws.Robot:
    """An arm of three voxels on a post of two, the post's feet heavy enough to carry it."""
    mask = np.zeros((4, 1, 2), bool)
    mask[0, 0, :], mask[:, 0, 1] = True, True
    body = ws.shapes.voxels(mask, edge=0.1, mass_per_vertex=0.1, stiffness=20_000.0)
    masses = np.where(body.positions[:, 2] < 0.05, 2.0, body.masses)
    return body.replace(masses=masses)


def breathing_cube() -> ws.Robot:
    """A cube that stands on the ground and breathes askew, so that its feet slide and stick."""
    cube = ws.shapes.cube(stiffness=5000.0).moved((0.0, 0.0, -2e-5))
    middle = cube.positions[cube.springs].mean(axis=1) / 0.1
    phase = 2.0 * middle[:, 0] + 1.5 * middle[:, 2]
    return cube.replace(amplitude=0.1 * cube.rest_length, phase=phase, omega=10.0)


def inchworm() -> ws.Robot:
    """Three voxels in a row; a wave runs through them twice a second, and they walk."""
    body = ws.shapes.lattice(3, 1, 1, edge=0.1, mass_per_vertex=0.1, stiffness=2000.0)
    body = body.moved((0.0, 0.0, -3e-5))
    middle = body.positions[body.springs].mean(axis=1) / 0.1
    phase = 2.0 * middle[:, 0] + 1.5 * middle[:, 2]
    return body.replace(amplitude=0.1 * body.rest_length, phase=phase, omega=4.0 * np.pi)
