"""A plan: a body as plain arrays that operators copy, change and tidy up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

__all__ = ["PHASE", "REST", "STIFFNESS", "SWING", "Plan", "connected_parts", "tidied"]

REST, SWING, PHASE, STIFFNESS = range(4)
"""Columns of the genes of a spring."""


@dataclass(frozen=True)
class Plan:
    """A body before it is built. Its arrays are never changed in place.

    Everything is float32 or int32, so that a plan survives its bytes exactly.
    """

    positions: np.ndarray
    """Places of the masses [m], shape (M, 3), float32."""
    shares: np.ndarray
    """Share of the total mass that each has, in any unit, positive, shape (M,), float32."""
    springs: np.ndarray
    """The two masses that each spring joins, shape (S, 2), int32."""
    genes: np.ndarray
    """Of each spring, in [0, 1]: rest length, swing, phase [cycles], and logarithm of the
    stiffness, each within bounds that the encoding knows, shape (S, 4), float32."""
    faces: np.ndarray
    """Corners of the outer triangles, shape (T, 3), int32."""

    @property
    def n_masses(self) -> int:
        """Number of masses M."""
        return len(self.positions)

    @property
    def n_springs(self) -> int:
        """Number of springs S."""
        return len(self.springs)

    @property
    def lengths(self) -> np.ndarray:
        """Length of every spring [m], shape (S,)."""
        ends = self.positions[self.springs].astype(np.float64)
        return np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)

    @property
    def degrees(self) -> np.ndarray:
        """Number of springs at every mass, shape (M,)."""
        return np.bincount(self.springs.ravel(), minlength=self.n_masses)

    @property
    def extent(self) -> float:
        """Longest side of the bounding box [m]."""
        return float(np.ptp(self.positions, axis=0).max())

    def neighbours(self, mass: int) -> np.ndarray:
        """The masses that springs join to one."""
        here = self.springs == mass
        return self.springs[here.any(axis=1)][~here[here.any(axis=1)]]

    def without(self, masses: np.ndarray) -> Plan:
        """The plan without some masses, (M,) bool, and without what hung on them."""
        number = np.cumsum(~masses) - 1
        springs = ~masses[self.springs].any(axis=1)
        faces = ~masses[self.faces].any(axis=1)
        return Plan(
            self.positions[~masses],
            self.shares[~masses],
            number[self.springs[springs]].astype(np.int32),
            self.genes[springs],
            number[self.faces[faces]].astype(np.int32),
        )

    def with_springs(self, pairs: np.ndarray, genes: np.ndarray) -> Plan:
        """The plan with more springs, (K, 2) and their genes (K, 4)."""
        return replace(
            self,
            springs=np.concatenate([self.springs, np.asarray(pairs, np.int32).reshape(-1, 2)]),
            genes=np.concatenate([self.genes, np.asarray(genes, np.float32).reshape(-1, 4)]),
        )


def connected_parts(n: int, pairs: np.ndarray) -> np.ndarray:
    """Which part of a graph each of n nodes belongs to: its lowest node, shape (n,)."""
    label = np.arange(n)
    if not len(pairs):
        return label
    a, b = np.asarray(pairs).T
    while True:
        low = np.minimum(label[a], label[b])
        lower = label.copy()
        np.minimum.at(lower, a, low)
        np.minimum.at(lower, b, low)
        lower = lower[lower]  # a node follows where its label went
        if np.array_equal(lower, label):
            return label
        label = lower


def tidied(plan: Plan, least_springs: int = 3) -> Plan:
    """The plan as a body should be: one part, nothing double, nothing that dangles.

    Springs of no length, from a mass to itself, or beside another between the same masses vanish;
    so do masses that fewer springs hold than `least_springs` (three hold a mass in space), all
    parts but that with most masses, and faces that are double or collapsed. Springs join the lower
    mass to the higher and are sorted, so that equal bodies have equal topologies.

    Args:
        plan: Any plan whose indices are in range.
        least_springs: How many springs hold a mass that may stay.
    """
    plan = _single(plan)
    while plan.n_masses:
        loose = plan.degrees < least_springs
        part = connected_parts(plan.n_masses, plan.springs)
        if plan.n_masses:
            loose |= part != np.bincount(part).argmax()
        if not loose.any():
            break
        plan = plan.without(loose)
    return plan


def _single(plan: Plan) -> Plan:
    """Without double and collapsed springs and faces, the springs in their canonical order."""
    springs = np.sort(plan.springs, axis=1)
    good = (springs[:, 0] != springs[:, 1]) & (plan.lengths > 1e-6)
    springs, genes = springs[good], plan.genes[good]
    code = springs[:, 0].astype(np.int64) * max(plan.n_masses, 1) + springs[:, 1]
    _, first = np.unique(code, return_index=True)
    faces = plan.faces
    if len(faces):
        corners = np.sort(faces, axis=1)
        whole = (np.diff(corners, axis=1) > 0).all(axis=1)
        _, at = np.unique(corners, axis=0, return_index=True)
        faces = faces[np.sort(at[whole[at]])]
    return replace(
        plan,
        springs=springs[first].astype(np.int32),
        genes=genes[first],
        faces=faces.astype(np.int32).reshape(-1, 3),
    )
