"""Building robots from plans, within limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evolve.bodies.plan import PHASE, REST, STIFFNESS, SWING, Plan

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.encodings.evolving import BodySettings

__all__ = ["fits", "planned", "robot"]


def fits(plan: Plan, settings: BodySettings) -> bool:
    """Whether a tidy plan is a body at all, and within the limits."""
    return (
        4 <= plan.n_masses <= settings.most_masses
        and 6 <= plan.n_springs <= settings.most_springs
        and plan.extent <= settings.largest_extent * (1.0 + 1e-6)
    )


def robot(plan: Plan, settings: BodySettings) -> ws.Robot:
    """The robot of a tidy plan: of the mass that the settings say, its lowest point on the ground.

    L0(t) = a + b sin(2 pi t / period + c) for every spring, from its genes.

    Raises:
        ValueError: The plan has no mass.
    """
    import warp_springs as ws

    if not plan.n_masses:
        raise ValueError("a plan without masses cannot be built")
    positions = plan.positions.astype(np.float64)
    positions = positions - [*positions[:, :2].mean(axis=0), positions[:, 2].min()]
    genes, lengths = plan.genes.astype(np.float64), plan.lengths
    (low, high), (soft, hard) = settings.rest_length, settings.stiffness
    shares = plan.shares.astype(np.float64)
    return ws.Robot(
        masses=settings.weight(len(shares)) * shares / shares.sum(),
        positions=positions,
        springs=plan.springs,
        stiffness=soft * (hard / soft) ** genes[:, STIFFNESS],
        rest_length=lengths * (low + (high - low) * genes[:, REST]),
        amplitude=lengths * settings.amplitude * genes[:, SWING],
        phase=2.0 * np.pi * genes[:, PHASE],
        omega=2.0 * np.pi / settings.period,
        faces=plan.faces,
    )


def planned(body: ws.Robot) -> Plan:
    """The plan of a robot, its springs at rest and half as stiff as may be."""
    genes = np.zeros((body.n_springs, 4), np.float32)
    genes[:, [REST, STIFFNESS]] = 0.5
    return Plan(
        body.positions.astype(np.float32),
        (body.masses / body.mass).astype(np.float32),
        body.springs.astype(np.int32),
        genes,
        body.faces.astype(np.int32),
    )
