"""The surface of a plan while its masses come and go."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from evolve.bodies.plan import Plan

__all__ = ["capped", "closed_without"]


def capped(plan: Plan, face: int, tip: int) -> Plan:
    """The plan with a triangle replaced by the three between its sides and a tip."""
    a, b, c = plan.faces[face]
    sides = np.array([[a, b, tip], [b, c, tip], [c, a, tip]], np.int32)
    return replace(plan, faces=np.concatenate([np.delete(plan.faces, face, 0), sides]))


def closed_without(plan: Plan, mass: int) -> Plan:
    """The plan without a mass, the hole in its surface filled where its rim is one ring."""
    here = plan.faces == mass
    following = {}
    for face, at in zip(plan.faces[here.any(axis=1)], here[here.any(axis=1)], strict=True):
        place = int(at.argmax())
        following[int(face[(place + 1) % 3])] = int(face[(place + 2) % 3])
    ring = _ring(following)
    fan = [[ring[0], b, c] for b, c in itertools.pairwise(ring[1:])]
    faces = np.concatenate([plan.faces, np.array(fan, np.int32).reshape(-1, 3)])
    return replace(plan, faces=faces).without(np.arange(plan.n_masses) == mass)


def _ring(following: dict[int, int]) -> list[int]:
    """The closed chain of all entries, each leading to the next; empty where there is none."""
    if not following:
        return []
    ring = [next(iter(following))]
    while len(ring) < len(following) and following.get(ring[-1]) in following:
        ring.append(following[ring[-1]])
    closed = following.get(ring[-1]) == ring[0] and len(set(ring)) == len(following)
    return ring if closed else []
