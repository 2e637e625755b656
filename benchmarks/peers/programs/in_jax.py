"""JAX on the CPU: whole arrays under ``jit``, and unrolled springs by an expert."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from peers.problem import Problem

__all__ = ["PROGRAMS", "JaxArrays", "JaxUnrolled", "versions"]

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_platforms", "cpu")

SPRING_FIELDS = ("stiffness", "rest_length", "amplitude", "phase")


class JaxArrays:
    """All robots at once; forces are scattered by ``.at[].add``; the steps are one jitted loop."""

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        self.real, self.first = np.dtype(precision), 0
        fields = {name: getattr(problem, name).astype(precision) for name in SPRING_FIELDS}
        fields |= {name: getattr(problem, name).astype(precision) for name in ("masses", "omega")}
        fields["gravity"] = problem.gravity.astype(precision)
        self.fields = {name: jnp.asarray(value) for name, value in fields.items()}
        self.state = tuple(
            jnp.asarray(values.astype(precision))
            for values in (problem.positions, problem.velocities)
        )
        self.advance = jax.jit(functools.partial(self._advance, problem))

    def _advance(self, p: Problem, fields, state, first, last):
        def step(n, state):
            return self._step(p, fields, state, n.astype(self.real))

        return jax.lax.fori_loop(first, last, step, state)

    def _step(self, p: Problem, fields, state, n):
        (x, v), (i, j), m = state, p.springs.T, fields["masses"][:, :, None]
        d = x[:, j] - x[:, i]
        length = jnp.sqrt((d * d).sum(axis=2))
        angle = fields["omega"][:, None] * (n * p.dt) + fields["phase"]
        rest = fields["rest_length"] + fields["amplitude"] * jnp.sin(angle)
        pulls = (fields["stiffness"] * (length - rest) / length)[:, :, None] * d
        force = jnp.zeros_like(x).at[:, i].add(pulls).at[:, j].add(-pulls)
        force = force + m * fields["gravity"]
        if p.ground_stiffness:
            force, v = touch(p, x[..., 2:], force, v)
        v = (v + force / m * p.dt) * p.keep
        return x + v * p.dt, v

    def run(self, steps: int) -> None:
        """Step all robots."""
        self.state = self.advance(self.fields, self.state, self.first, self.first + steps)
        jax.block_until_ready(self.state)
        self.first += steps

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return np.asarray(self.state[0], np.float64)


def touch(p: Problem, z, force, v):
    """Forces and velocities (..., 3) after the ground and the classroom's friction."""
    normal = p.ground_stiffness * jnp.maximum(-z, 0.0)
    along = jnp.sqrt(force[..., :1] ** 2 + force[..., 1:2] ** 2)
    sticks = (z < 0.0) & (along < p.static_friction * normal)
    slides = (z < 0.0) & ~sticks
    left = jnp.where(slides, jnp.maximum(1.0 - p.kinetic_friction * normal / along, 0.0), 1.0)
    left = jnp.where(sticks, 0.0, left)
    force = jnp.concatenate([force[..., :2] * left, force[..., 2:] + normal], axis=-1)
    flat = jnp.where(sticks, 0.0, v[..., :2])
    return force, jnp.concatenate([flat, v[..., 2:]], axis=-1)


class JaxUnrolled:
    """Robots innermost, every spring of the body its own expressions, the sine split: all fuse."""

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        p, self.first, self.dt, self.omega = problem, 0, problem.dt, problem.omega
        self.real = np.dtype(precision)
        k, swing = p.stiffness, p.stiffness * p.amplitude
        table = [k, k * p.rest_length, swing * np.cos(p.phase), swing * np.sin(p.phase)]
        self.springs = jnp.asarray(np.stack(table).transpose(2, 0, 1).astype(precision))
        self.kick = jnp.asarray((p.dt * p.keep / p.masses).T.astype(precision))
        self.state = tuple(
            jnp.asarray(np.ascontiguousarray(values.transpose(1, 2, 0)).astype(precision))
            for values in (p.positions, p.velocities)
        )
        self.advance = jax.jit(functools.partial(self._advance, p))

    def _advance(self, p: Problem, springs, kick, state, first, turn, steps):
        def step(_, carry):
            x, v, sine, cosine = carry
            x, v = self._step(p, springs, kick, x, v, sine, cosine)
            return x, v, sine * turn[1] + cosine * turn[0], cosine * turn[1] - sine * turn[0]

        return jax.lax.fori_loop(0, steps, step, (*state, *first))[:2]

    def _step(self, p: Problem, springs, kick, x, v, sine, cosine):
        forces = [[0.0, 0.0, 0.0] for _ in range(p.n_masses)]
        for s, (i, j) in enumerate(p.springs.tolist()):
            k, constant, of_sine, of_cosine = springs[s]
            d = [x[j, c] - x[i, c] for c in range(3)]
            q = constant + of_sine * sine + of_cosine * cosine
            pull = k - q * jax.lax.rsqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            for c in range(3):
                forces[i][c] += pull * d[c]
                forces[j][c] -= pull * d[c]
        force = jnp.stack([jnp.stack(f) for f in forces])
        fall = (p.gravity * p.dt * p.keep).astype(self.real)
        added = force * kick[:, None] + fall[:, None]
        if p.ground_stiffness:
            added, v = touch_rows(p, x[:, 2] * kick, added, v)
        v = v * p.keep + added
        return x + v * p.dt, v

    def run(self, steps: int) -> None:
        """Step all robots."""
        angles = self.omega * self.dt * np.array([self.first, 1])[:, None]
        first, turn = np.stack([np.sin(angles), np.cos(angles)], axis=1).astype(self.real)
        arguments = (self.springs, self.kick, self.state, tuple(first), turn)
        self.state = self.advance(*arguments, steps)
        jax.block_until_ready(self.state)
        self.first += steps

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return np.asarray(self.state[0], np.float64).transpose(2, 0, 1)


def touch_rows(p: Problem, depth, added, v):
    """Added velocities and velocities (M, 3, N) after the ground and its friction.

    ``depth``: height times what a newton adds, shape (M, N).
    """
    push = p.ground_stiffness * jnp.maximum(-depth, 0.0)
    along = jnp.sqrt(added[:, 0] ** 2 + added[:, 1] ** 2)
    sticks = along < p.static_friction * push
    left = jnp.maximum(1.0 - p.kinetic_friction * push / jnp.maximum(along, 1e-30), 0.0)
    left = jnp.where(sticks, 0.0, left)[:, None]
    flat = jnp.where(sticks[:, None], 0.0, v[:, :2])
    added = jnp.concatenate([added[:, :2] * left, added[:, 2:] + push[:, None]], axis=1)
    return added, jnp.concatenate([flat, v[:, 2:]], axis=1)


PROGRAMS = {"JAX": JaxArrays, "JAX unrolled": JaxUnrolled}


def versions() -> dict[str, str]:
    """The version of JAX."""
    return {"jax": jax.__version__}
