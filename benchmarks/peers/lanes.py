"""The population with robots as lanes, for the programs that an expert writes; NumPy only."""

from dataclasses import dataclass

import numpy as np

from peers.problem import Problem

__all__ = ["Lanes"]


@dataclass(frozen=True)
class Lanes:
    """G groups of W robots; the innermost index is the robot, so that loops over it are SIMD.

    Springs are sorted into rows by their lower mass, so that a mass can be moved when its row ends.
    The last group is filled up with the last robot.

    Attributes:
        rows: Where the row of each mass starts, shape (M + 1,).
        partners: The higher mass of each sorted spring, shape (S,).
        x: Positions [m], shape (G, M, 3, W).
        v: Velocities [m/s], shape (G, M, 3, W).
        kick: What a newton adds to the kept velocity [m/s], shape (G, M, W).
        springs: k, k L0, and what of k L0(t) goes with sine and cosine, shape (G, S, 4, W).
        turn: Sine and cosine of the angle of a step, shape (G, 2, W).
        angle: The angle of a step [rad], shape (G, W), float64.
        fall: What gravity adds to the kept velocity [m/s], shape (3,).
        world: dt, keep, ground stiffness, static and kinetic friction, shape (5,).
    """

    rows: np.ndarray
    partners: np.ndarray
    x: np.ndarray
    v: np.ndarray
    kick: np.ndarray
    springs: np.ndarray
    turn: np.ndarray
    angle: np.ndarray
    fall: np.ndarray
    world: np.ndarray

    @classmethod
    def of(cls, p: Problem, precision: str, width: int) -> "Lanes":
        """The population of a problem in groups of ``width`` robots."""
        ends = np.sort(p.springs, axis=1)
        order = np.lexsort((ends[:, 1], ends[:, 0]))
        groups = -(-p.n_robots // width)
        robots = np.minimum(np.arange(groups * width), p.n_robots - 1)

        def lanes(values: np.ndarray) -> np.ndarray:
            block = values[robots].reshape(groups, width, *values.shape[1:])
            return np.ascontiguousarray(np.moveaxis(block, 1, -1).astype(precision))

        k = p.stiffness[:, order]
        swing, phase = k * p.amplitude[:, order], p.phase[:, order]
        table = [k, k * p.rest_length[:, order], swing * np.cos(phase), swing * np.sin(phase)]
        turn = np.stack([np.sin(p.omega * p.dt), np.cos(p.omega * p.dt)], axis=1)
        world = [p.dt, p.keep, p.ground_stiffness, p.static_friction, p.kinetic_friction]
        return cls(
            rows=np.searchsorted(ends[order, 0], np.arange(p.n_masses + 1)).astype(np.uint32),
            partners=ends[order, 1].astype(np.uint32),
            x=lanes(p.positions),
            v=lanes(p.velocities),
            kick=lanes(p.dt * p.keep / p.masses),
            springs=lanes(np.stack(table, axis=2)),
            turn=lanes(turn),
            angle=(p.omega * p.dt)[robots].reshape(groups, width),
            fall=(p.gravity * p.dt * p.keep).astype(precision),
            world=np.array(world, precision),
        )

    def wave(self, steps: int) -> np.ndarray:
        """Sine and cosine of the angle after so many steps, shape (G, 2, W)."""
        angle = self.angle * steps
        return np.stack([np.sin(angle), np.cos(angle)], axis=1).astype(self.x.dtype)

    def robots_first(self, x: np.ndarray, robots: int) -> np.ndarray:
        """Positions (G, M, 3, W) as (N, M, 3), float64."""
        return np.moveaxis(x, -1, 1).reshape(-1, *x.shape[1:3])[:robots].astype(np.float64)
