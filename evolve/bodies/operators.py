"""Direct operators on bodies: each makes a changed plan, or None where it has nothing to change.

Every operator is a function ``(plan, rng) -> Plan | None`` of a tidy plan. It keeps indices and
faces in order, but what it makes may have dangling parts or be too large: `varied` tidies up and
refuses what is no longer a body.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from evolve.bodies.plan import PHASE, REST, STIFFNESS, SWING, Plan, tidied
from evolve.bodies.surface import capped, closed_without
from evolve.encodings.base import folded

__all__ = ["BODY", "CONTROL", "Operator", "crossed", "varied"]

Operator = Callable[[Plan, np.random.Generator], Plan | None]

STEP = 0.2
"""Standard deviation of a change of a gene, and of a place in lengths of springs."""


def varied(
    plan: Plan,
    operators: tuple[Operator, ...],
    fits: Callable[[Plan], bool],
    rng: np.random.Generator,
    attempts: int = 8,
) -> Plan:
    """Apply one of some operators, and tidy up.

    Args:
        plan: A tidy plan.
        operators: Among which chance decides.
        fits: Whether a tidy plan is within the limits.
        rng: Chance.
        attempts: How many operators are tried before the plan stays as it is.
    """
    for _ in range(attempts):
        changed = operators[rng.integers(len(operators))](plan, rng)
        if changed is not None and fits(changed := tidied(changed)):
            return changed
    return plan


# -- controllers ----------------------------------------------------------------------------------


def change_rest_length(plan: Plan, rng: np.random.Generator) -> Plan:
    """Other rest lengths for a spring and at times those near it."""
    return _shifted(plan, rng, (REST,))


def change_actuation(plan: Plan, rng: np.random.Generator) -> Plan:
    """Another swing and phase for a spring and at times those near it."""
    return _shifted(plan, rng, (SWING, PHASE))


def change_material(plan: Plan, rng: np.random.Generator) -> Plan:
    """Another stiffness for a spring and at times those near it."""
    return _shifted(plan, rng, (STIFFNESS,))


def make_alike(plan: Plan, rng: np.random.Generator) -> Plan:
    """One set of genes for all springs within a ball: a muscle, a bone."""
    genes, near = plan.genes.copy(), _ball(plan, rng)
    genes[near] = rng.random(4)
    return replace(plan, genes=genes)


def _shifted(plan: Plan, rng: np.random.Generator, columns: tuple[int, ...]) -> Plan:
    genes, near = plan.genes.copy(), _ball(plan, rng)
    if rng.random() < 0.5:
        near = near[:1]
    for column in columns:
        moved = genes[near, column] + np.float32(STEP * rng.standard_normal())
        genes[near, column] = folded(moved, column == PHASE)
    return replace(plan, genes=genes)


def _ball(plan: Plan, rng: np.random.Generator) -> np.ndarray:
    """A spring, and those whose middles are near: indices."""
    middles = plan.positions[plan.springs].mean(axis=1)
    one = rng.integers(plan.n_springs)
    apart = np.linalg.norm(middles - middles[one], axis=1)
    reach = rng.random() ** 2 * 0.5 * plan.extent
    others = np.flatnonzero((apart <= reach) & (np.arange(plan.n_springs) != one))
    return np.append(one, others)


# -- springs and masses ---------------------------------------------------------------------------


def add_spring(plan: Plan, rng: np.random.Generator) -> Plan | None:
    """Join a mass to one of the nearest to which no spring leads."""
    mass = int(rng.integers(plan.n_masses))
    far = _distances(plan, mass)
    far[plan.neighbours(mass)] = np.inf
    free = [i for i in np.argsort(far)[:4] if np.isfinite(far[i])]
    if not free:
        return None
    return plan.with_springs([[mass, free[rng.integers(len(free))]]], _borrowed(plan, 1, rng))


def remove_spring(plan: Plan, rng: np.random.Generator) -> Plan:
    """Cut a spring; a mass that fewer than three hold falls off."""
    kept = np.arange(plan.n_springs) != rng.integers(plan.n_springs)
    return replace(plan, springs=plan.springs[kept], genes=plan.genes[kept])


def split_spring(plan: Plan, rng: np.random.Generator) -> Plan:
    """Put a mass into the middle of a spring, and hold it by masses that both ends know."""
    one = int(rng.integers(plan.n_springs))
    a, b = plan.springs[one]
    middle = plan.positions[[a, b]].mean(axis=0)
    common = np.intersect1d(plan.neighbours(a), plan.neighbours(b))
    away = np.linalg.norm(plan.positions[common] - middle, axis=1)
    held = np.concatenate([[a, b], common[np.argsort(away, kind="stable")[:4]]])
    cut = replace(
        plan, springs=np.delete(plan.springs, one, 0), genes=np.delete(plan.genes, one, 0)
    )
    genes = np.concatenate([plan.genes[[one, one]], _borrowed(plan, len(held) - 2, rng)])
    return _grown(cut, middle, held, genes)


def add_mass(plan: Plan, rng: np.random.Generator) -> Plan | None:
    """Put a tip on a triangle of the surface; on any three neighbours where there is none."""
    if len(plan.faces):
        face = int(rng.integers(len(plan.faces)))
        corners = plan.faces[face]
    else:
        mass = int(rng.integers(plan.n_masses))
        face, corners = -1, np.argsort(_distances(plan, mass), kind="stable")[:2]
        corners = np.append(corners, mass)
    a, b, c = plan.positions[corners].astype(np.float64)
    normal = np.cross(b - a, c - a)
    area = float(np.linalg.norm(normal))
    if area < 1e-12:
        return None
    height = np.sqrt(area) * rng.uniform(0.5, 1.2)
    tip = (a + b + c) / 3.0 + normal / area * height
    # Besides the corners, the nearest mass: a tip that only three hold swings easily.
    away = np.linalg.norm(plan.positions - tip, axis=1)
    away[corners] = np.inf
    held = np.append(corners, np.argsort(away, kind="stable")[: int(plan.n_masses > 3)])
    grown = _grown(plan, tip, held, _borrowed(plan, len(held), rng))
    return grown if face < 0 else capped(grown, face, plan.n_masses)


def remove_mass(plan: Plan, rng: np.random.Generator) -> Plan:
    """Take a mass out with its springs, and close the surface over it."""
    return closed_without(plan, int(rng.integers(plan.n_masses)))


def move_weight(plan: Plan, rng: np.random.Generator) -> Plan:
    """Give some of the weight of a mass to another; together they weigh what they did."""
    a, b = rng.choice(plan.n_masses, 2, replace=False)
    shares = plan.shares.copy()
    # Nobody gets lighter than a tenth of the mean: a light mass makes the time step short.
    spare = max(float(shares[a]) - 0.1 * float(shares.mean()), 0.0)
    moved = np.float32(spare * rng.random())
    shares[a] -= moved
    shares[b] += moved
    return replace(plan, shares=shares)


def move_place(plan: Plan, rng: np.random.Generator) -> Plan:
    """Shift a mass, by some of the length of its springs."""
    positions = plan.positions.copy()
    step = STEP * float(np.median(plan.lengths)) * rng.standard_normal(3)
    positions[rng.integers(plan.n_masses)] += step.astype(np.float32)
    return replace(plan, positions=positions)


def _grown(plan: Plan, place: np.ndarray, held: np.ndarray, genes: np.ndarray) -> Plan:
    """The plan with a mass at a place, of the mean weight, held by some others."""
    new = plan.n_masses
    more = replace(
        plan,
        positions=np.concatenate([plan.positions, [place.astype(np.float32)]]),
        shares=np.append(plan.shares, plan.shares.mean()).astype(np.float32),
    )
    return more.with_springs([[i, new] for i in held], genes)


def _borrowed(plan: Plan, n: int, rng: np.random.Generator) -> np.ndarray:
    """Genes for n new springs: those of springs that are there."""
    return plan.genes[rng.integers(plan.n_springs, size=n)]


def _distances(plan: Plan, mass: int) -> np.ndarray:
    """From a mass to all, infinite to itself."""
    apart = np.linalg.norm(plan.positions - plan.positions[mass], axis=1).astype(np.float64)
    apart[mass] = np.inf
    return apart


# -- limbs ----------------------------------------------------------------------------------------


def mirror(plan: Plan, rng: np.random.Generator) -> Plan | None:
    """Replace one half of the body by the mirror image of the other, half a cycle later."""
    axis, keep = int(rng.integers(2)), rng.choice([-1.0, 1.0])
    middle = np.float32(plan.positions[:, axis].mean())
    offset = keep * (plan.positions[:, axis] - middle)
    near = np.float32(0.05 * plan.extent)
    half = plan.without(offset < -near)
    if half.n_masses < 2 or half.n_springs < 3:
        return None
    # Masses near the plane come to lie in it: they are their own images.
    positions = half.positions.copy()
    inside = np.abs(positions[:, axis] - middle) <= near
    positions[inside, axis] = middle
    half = replace(half, positions=positions)
    image, own = _image(half, axis, middle), half.n_masses
    number = np.where(inside, np.arange(own), own + np.cumsum(~inside) - 1)
    image = replace(image, springs=number[image.springs], faces=number[image.faces])
    both = Plan(
        np.concatenate([half.positions, image.positions[~inside]]),
        np.concatenate([half.shares, image.shares[~inside]]),
        np.concatenate([half.springs, image.springs]).astype(np.int32),
        np.concatenate([half.genes, image.genes]),
        np.concatenate([half.faces, image.faces]).astype(np.int32),
    )
    return _sewn(both, np.arange(both.n_masses) >= own, rng)


def duplicate_limb(plan: Plan, rng: np.random.Generator) -> Plan | None:
    """Copy what is near the tip of the body in some direction to the other side of it."""
    direction = rng.standard_normal(3) * (1.0, 1.0, 0.5)
    direction /= np.linalg.norm(direction)
    along = (plan.positions - plan.positions.mean(axis=0)) @ direction
    cut = along.max() - rng.uniform(0.2, 0.5) * np.ptp(along)
    limb = plan.without(along < cut)
    if limb.n_masses < 3 or limb.n_masses > plan.n_masses - 3:
        return None
    axis = int(np.argmax(np.abs(direction[:2])))
    copy = _image(limb, axis, np.float32(plan.positions[:, axis].mean()))
    # Where the body is already, a copy would lie within it.
    apart = np.linalg.norm(copy.positions[:, None] - plan.positions[None], axis=2).min(axis=1)
    copy = copy.without(apart < 0.2 * float(np.median(plan.lengths)))
    if copy.n_masses < 1:
        return None
    both = _beside(plan, copy)
    return _sewn(both, np.arange(both.n_masses) >= plan.n_masses, rng)


def crossed(one: Plan, other: Plan, rng: np.random.Generator) -> Plan | None:
    """What lies on one side of a plane from one plan, on its other side from the other."""
    normal = rng.standard_normal(3)
    normal /= np.linalg.norm(normal)
    parts = []
    for plan, sign in ((one, 1.0), (other, -1.0)):
        centred = plan.positions - plan.positions.mean(axis=0).astype(np.float32)
        centred[:, 2] = plan.positions[:, 2] - plan.positions[:, 2].min()
        along = centred - [0.0, 0.0, np.median(centred[:, 2])]
        parts.append(replace(plan, positions=centred).without(sign * (along @ normal) < 0.0))
    if min(part.n_masses for part in parts) < 2 or not sum(p.n_springs for p in parts):
        return None
    both = _beside(*parts)
    return _sewn(both, np.arange(both.n_masses) >= parts[0].n_masses, rng)


def _image(plan: Plan, axis: int, middle: np.float32) -> Plan:
    """The mirror image in the plane across an axis, half a cycle later; faces still look out."""
    positions, genes = plan.positions.copy(), plan.genes.copy()
    positions[:, axis] = 2.0 * middle - positions[:, axis]
    genes[:, PHASE] = folded(genes[:, PHASE] + np.float32(0.5), True)
    return replace(plan, positions=positions, genes=genes, faces=plan.faces[:, ::-1])


def _beside(one: Plan, other: Plan) -> Plan:
    """Two plans as one, not joined yet."""
    return Plan(
        np.concatenate([one.positions, other.positions]),
        np.concatenate([one.shares, other.shares]),
        np.concatenate([one.springs, other.springs + one.n_masses]).astype(np.int32),
        np.concatenate([one.genes, other.genes]),
        np.concatenate([one.faces, other.faces + one.n_masses]).astype(np.int32),
    )


def _sewn(plan: Plan, second: np.ndarray, rng: np.random.Generator) -> Plan | None:
    """Join two parts of a plan, (M,) bool, where they are nearest: each seam mass to three."""
    ours, theirs = np.flatnonzero(~second), np.flatnonzero(second)
    if not len(ours) or not len(theirs) or not plan.n_springs:
        return None
    gap = np.linalg.norm(plan.positions[ours][:, None] - plan.positions[theirs][None], axis=2)
    reach = gap.min() + 0.7 * float(np.median(plan.lengths))
    seam = np.flatnonzero(gap.min(axis=0) <= reach)
    nearest = np.argsort(gap[:, seam], axis=0, kind="stable")[:3]
    pairs = np.stack([ours[nearest], np.broadcast_to(theirs[seam], nearest.shape)], axis=2)
    pairs = pairs.reshape(-1, 2)
    return plan.with_springs(pairs, _borrowed(plan, len(pairs), rng))


CONTROL: tuple[Operator, ...] = (
    change_rest_length,
    change_actuation,
    change_material,
    make_alike,
    change_actuation,  # twice as often: phases need most tuning
)
"""What changes how a body moves."""
BODY: tuple[Operator, ...] = (
    add_spring,
    remove_spring,
    split_spring,
    add_mass,
    remove_mass,
    move_weight,
    move_place,
    mirror,
    duplicate_limb,
)
"""What changes the body itself."""
