"""Robots that a search may make and nobody would build: well formed, and absurd.

Robot ``index`` of ``seed`` is the same whatever else is made. Kinds take turns.
"""

from collections.abc import Callable

import numpy as np

import warp_springs as ws

__all__ = ["KINDS", "garbage", "healthy"]

#: One robot in so many is a star; they are large.
STARS = 250
STAR_MASSES = 2000


def garbage(seed: int, index: int) -> tuple[str, ws.Robot | None]:
    """The kind of a robot, and the robot, or None where the constructor refused it."""
    sequence = np.random.SeedSequence(seed, spawn_key=(index,))
    rng = np.random.Generator(np.random.Philox(sequence))
    kind = "star" if index % STARS == 7 else tuple(KINDS)[index % len(KINDS)]
    make = _star if kind == "star" else KINDS[kind]
    try:
        return kind, make(rng)
    except ValueError:
        return kind, None


def healthy() -> list[ws.Robot]:
    """Neighbours for them: some share a topology, and so a bundle, with garbage."""
    cube = ws.shapes.cube()
    lattice = ws.shapes.lattice(2, 1, 1, stiffness=1500.0)
    breathing = {"amplitude": 0.08 * lattice.rest_length, "omega": 12.0}
    turned = [
        cube.rotated((1, 2, 3), 0.7).spinning((3.0, -2.0, 4.0)),
        cube.replace(amplitude=0.01, omega=9.0).rotated((0, 1, 1), 0.4),
        ws.shapes.tetrahedron().rotated((1, 1, 0), 0.4),
        ws.shapes.octahedron().spinning((1.0, 1.0, 1.0)),
        lattice.replace(**breathing, phase=np.linspace(0.0, 6.0, lattice.n_springs)),
        ws.shapes.lattice(3, 1, 2).rotated((0, 0, 1), 0.3),  # a topology of its own
    ]
    return [robot.moved((0.0, 0.0, 0.002 - robot.bounds[0, 2])) for robot in turned]


def _decades(rng: np.random.Generator, low: float, high: float, size=None):
    return 10.0 ** rng.uniform(low, high, size)


def _body(rng: np.random.Generator) -> ws.Robot:
    """A shape in any pose near the ground."""
    shapes = ws.shapes
    made = (
        shapes.cube,
        shapes.tetrahedron,
        shapes.octahedron,
        lambda: shapes.lattice(2, 1, 1),
        lambda: shapes.lattice(1, 2, 1),
    )
    body = made[rng.integers(len(made))]()
    turned = body.rotated(rng.normal(size=3), rng.uniform(0.0, 3.0))
    return turned.moved((0.0, 0.0, rng.uniform(-0.05, 0.3)))


def _uneven(rng: np.random.Generator) -> ws.Robot:
    """Fifteen decades of stiffness and of mass within one robot."""
    body = _body(rng)
    k, m = _decades(rng, -3, 12, body.n_springs), _decades(rng, -9, 6, body.n_masses)
    return body.replace(stiffness=k, masses=m)


def _extreme(rng: np.random.Generator) -> ws.Robot:
    """One stiffness and one mass, each from fifteen decades."""
    return _body(rng).replace(stiffness=_decades(rng, -3, 12), masses=_decades(rng, -9, 6))


def _breathing(rng: np.random.Generator) -> ws.Robot:
    """Amplitudes above the rest length, frequencies above the step's."""
    body = _body(rng)
    return body.replace(
        stiffness=_decades(rng, 1, 6),
        amplitude=body.rest_length * _decades(rng, -1, 3),
        phase=rng.uniform(-10.0, 10.0, body.n_springs),
        omega=_decades(rng, -2, 5),
    )


def _tangled(rng: np.random.Generator) -> ws.Robot:
    """Random springs: some twice, some of no length, some with no rest length."""
    masses, springs = int(rng.integers(2, 25)), int(rng.integers(1, 60))
    positions = rng.normal(size=(masses, 3)) * _decades(rng, -3, 1)
    positions[rng.integers(masses)] = positions[rng.integers(masses)]
    start = rng.integers(masses, size=springs)
    end = (start + rng.integers(1, masses, size=springs)) % masses
    tame = rng.random() < 0.7
    rest = np.where(rng.random(springs) < 0.5, 0.0, _decades(rng, -3, 1, springs))
    return ws.Robot(
        masses=_decades(rng, *((-2, 1) if tame else (-9, 6)), masses),
        positions=positions + np.array([0.0, 0.0, rng.uniform(-0.1, 1.0)]),
        springs=np.stack([start, end], axis=1),
        stiffness=_decades(rng, *((-3, 4) if tame else (-3, 12)), springs),
        rest_length=rest if rng.random() < 0.5 else None,
        amplitude=_decades(rng, -3, 1, springs) if rng.random() < 0.5 else 0.0,
        omega=_decades(rng, -1, 3),
    )


def _apart(rng: np.random.Generator) -> ws.Robot:
    """Two bodies that nothing joins, as one robot."""
    return _tangled(rng).joined(_body(rng))


def _fast(rng: np.random.Generator) -> ws.Robot:
    """Speeds from 1 m/s to beyond what a number holds."""
    body = _body(rng)
    return body.replace(velocities=rng.normal(size=(body.n_masses, 3)) * _decades(rng, 0, 300))


def _far(rng: np.random.Generator) -> ws.Robot:
    return _body(rng).moved(rng.normal(size=3) * _decades(rng, 0, 300))


def _sized(rng: np.random.Generator) -> ws.Robot:
    """From smaller than an atom's nucleus to larger than the Earth's orbit."""
    return _body(rng).scaled(_decades(rng, -16, 12))


def _crumpled(rng: np.random.Generator) -> ws.Robot:
    """Some masses in one point."""
    body = _body(rng)
    return body.replace(
        positions=np.where(rng.random((body.n_masses, 1)) < 0.5, 0.05, body.positions)
    )


def _loose(rng: np.random.Generator) -> ws.Robot:
    """Masses without any spring."""
    masses = int(rng.integers(1, 20))
    return ws.Robot(
        masses=_decades(rng, -9, 6, masses),
        positions=rng.normal(size=(masses, 3)),
        velocities=rng.normal(size=(masses, 3)) * _decades(rng, -3, 6),
        springs=np.empty((0, 2), int),
        stiffness=[],
    )


def _star(rng: np.random.Generator) -> ws.Robot:
    """One hub, nearly two thousand arms."""
    arms = np.arange(1, STAR_MASSES)
    return ws.Robot(
        masses=_decades(rng, -3, 0),
        positions=rng.normal(size=(STAR_MASSES, 3)) * _decades(rng, -1, 1),
        springs=np.stack([np.zeros_like(arms), arms], axis=1),
        stiffness=_decades(rng, -1, 4),
    )


def _malformed(rng: np.random.Generator) -> ws.Robot:
    """A NaN or an infinity in one place of one field: the constructor must refuse it."""
    body = _body(rng)
    names = ("masses", "positions", "velocities", "stiffness", "rest_length", "amplitude", "phase")
    name = names[rng.integers(len(names))]
    values = np.array(getattr(body, name))
    values.flat[rng.integers(values.size)] = rng.choice([np.nan, np.inf, -np.inf])
    return body.replace(**{name: values})


KINDS: dict[str, Callable[[np.random.Generator], ws.Robot]] = {
    "uneven": _uneven,
    "extreme": _extreme,
    "breathing": _breathing,
    "tangled": _tangled,
    "apart": _apart,
    "fast": _fast,
    "far": _far,
    "sized": _sized,
    "crumpled": _crumpled,
    "loose": _loose,
    "malformed": _malformed,
}
