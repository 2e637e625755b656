"""Results whose motion is made up."""

import dataclasses
from types import SimpleNamespace

import numpy as np

import warp_springs as ws


def posed(robots, poses, ground=True, fps=30, times=None) -> ws.Result:
    """A result with these frames (F, M, 3) of each robot, the last of which is its end."""
    times = np.arange(len(poses[0])) / fps if times is None else times
    scene = ws.Scene(ground=ws.Ground() if ground else None)
    return dataclasses.replace(
        ws.Simulation(robots, scene, dt=1e-3).run(1e-3),
        times=times,
        end_time=float(times[-1]),
        recorded=tuple(range(len(robots))),
        _frames=dict(enumerate(poses)),
        _slots=SimpleNamespace(unpack=lambda _, robot: poses[robot][-1]),
    )
