"""Many bodies of voxels at once are those that one mask at a time gives."""

import numpy as np
import pytest

import warp_springs as ws


def masks(count: int, shape: tuple[int, int, int]) -> np.ndarray:
    found = np.random.default_rng(4).random((count, *shape)) < 0.5
    found[:, 0, 0, 0] |= ~found.any(axis=(1, 2, 3))
    return found


@pytest.mark.parametrize("shape", [(1, 1, 1), (3, 2, 4), (5, 5, 5)])
def test_every_body_is_that_of_its_mask(shape):
    wanted = masks(40, shape)
    cut = ws.shapes.Cut(wanted, edge=0.07)
    rng = np.random.default_rng(5)
    fields = {"amplitude": 0.1 * cut.lengths, "phase": rng.uniform(0.0, 6.0, len(cut.lengths))}
    stiffness, weights = rng.uniform(1e2, 1e4, len(cut.lengths)), rng.uniform(0.1, 0.2, 40)
    robots = cut.robots(weights, stiffness, 3.0, **fields)
    ends = np.cumsum(cut.n_springs)
    for i, (robot, mask) in enumerate(zip(robots, wanted, strict=True)):
        own = slice(ends[i] - cut.n_springs[i], ends[i])
        body = ws.shapes.voxels(mask, 0.07, weights[i]).replace(
            stiffness=stiffness[own], omega=3.0, **{name: v[own] for name, v in fields.items()}
        )
        assert robot == body and robot.topology == body.topology
        assert (cut.body[own] == i).all()
        with pytest.raises(ValueError, match="read-only"):
            robot.stiffness[0] = 1.0


def test_the_voxels_that_share_a_spring_contain_both_its_ends():
    cut = ws.shapes.Cut(np.ones((1, 3, 2, 2), bool), edge=1.0)
    (robot,) = cut.robots([1.0], np.ones(len(cut.lengths)))
    corner = np.array(np.unravel_index(np.arange(12), (3, 2, 2))).T
    for spring, voxels in zip(robot.springs, cut.sharing.T, strict=True):
        ends = robot.positions[spring]
        inside = ((ends[:, None] >= corner) & (ends[:, None] <= corner + 1)).all(axis=(0, 2))
        assert voxels[voxels < 12].tolist() == np.flatnonzero(inside).tolist()


def test_what_is_malformed_is_refused():
    with pytest.raises(ValueError, match=r"masks: float64 of shape \(2, 2\) given"):
        ws.shapes.Cut(np.ones((2, 2)))
    empty = np.ones((3, 2, 2, 2), bool)
    empty[1] = False
    with pytest.raises(ValueError, match=r"masks\[1\]: no voxel"):
        ws.shapes.Cut(empty)
    cut = ws.shapes.Cut(np.ones((2, 1, 1, 1), bool))
    with pytest.raises(ValueError, match=r"stiffness\[28\] = -1.0: must be finite and greater"):
        cut.robots([1.0, 1.0], np.where(np.arange(56) == 28, -1.0, 1.0))
    with pytest.raises(ValueError, match=r"stiffness: shape \(3,\) given, \(56,\) expected"):
        cut.robots([1.0, 1.0], np.ones(3))
