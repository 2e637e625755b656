"""How robots are stepped: integrator, precision, and the step of each robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_springs.engine.packing import Strip, breathes, fastest_actuation, largest
from warp_springs.kernels.law import DRIFTS, constants
from warp_springs.scene import Scene
from warp_springs.stability import Limits, certainly_unstable, stable_step

__all__ = ["AUTO_DT", "LEVELS", "Method"]

#: The step of a run with ``dt="auto"`` [s]; each robot takes it, or a power of two fewer.
AUTO_DT = 5e-4
#: Halvings of the step that ``dt="auto"`` may choose.
LEVELS = 12
#: The part of the largest stable step that ``dt="auto"`` stays within: at the limit itself the
#: fastest vibrations are bounded, but wrong.
AUTO_PART = 0.5
#: Steps of the contact flow within one drift: no fewer, no more, if the caller does not choose.
SUBSTEPS = (8, 1024)
#: Largest phase of a contact oscillation in a sub-step, beyond which bounces gain energy (measured:
#: three times in 20 s at 0.94, seven thousand times at 1.9). At 2 the sub-step itself is unstable:
#: the limit where the caller chooses their number, and for "euler", which has none.
LARGEST_CONTACT_PHASE = 0.5
#: Largest phase of the actuation in a step that dt="auto" chooses.
BREATHING_PHASE = 0.5


@dataclass(frozen=True)
class Method:
    """How the robots of a simulation are stepped.

    What it decides for a robot depends on that robot alone, so that its bits do not depend on the
    batch it is in.

    Attributes:
        dt: Step of the run [s].
        auto: Whether a robot's step is the step of the run divided by a power of two of its own.
        integrator: ``"chin4"``, ``"leapfrog"`` or ``"euler"``.
        precision: ``"float64"``, ``"float32"`` or ``"mixed"``.
        contact_substeps: Steps of the contact flow within one drift, or ``None`` to choose them.
        limits: What stops a robot.
    """

    dt: float
    auto: bool
    integrator: str
    precision: str
    contact_substeps: int | None
    limits: Limits

    def levels(self, strip: Strip, scene: Scene) -> np.ndarray:
        """Halvings of the step of the run for each robot, shape (n,)."""
        if not self.auto:
            return np.zeros(len(strip.ids), np.int64)
        wanted = self.dt / (AUTO_PART * stable_step(strip, scene, self.integrator))
        turn = fastest_actuation(strip) * self.dt / BREATHING_PHASE
        wanted = np.maximum(wanted, np.where(breathes(strip), turn, 0.0))
        levels = np.ceil(np.log2(np.clip(wanted, 1.0, 2.0**LEVELS))).astype(np.int64)
        # A robot that is refused even so is not stepped at all.
        return np.where(self.refused(strip, scene, levels), 0, levels)

    def substeps(self, strip: Strip, scene: Scene, levels: np.ndarray) -> np.ndarray:
        """Contact sub-steps in a drift of each robot, shape (n,).

        A power of two, within ``SUBSTEPS``, that keeps the phase of the fastest contact
        oscillation, sqrt(K_G / m) times a drift, below an eighth of a radian a sub-step.
        """
        if not scene.stiffest_surface or self.integrator == "euler":
            return np.ones(len(strip.ids), np.int64)
        if self.contact_substeps is not None:
            return np.full(len(strip.ids), self.contact_substeps, np.int64)
        wanted = np.clip(8.0 * self._contact_phase(strip, scene, levels), *SUBSTEPS)
        return 2 ** np.ceil(np.log2(wanted)).astype(np.int64)

    def _contact_phase(self, strip: Strip, scene: Scene, levels: np.ndarray) -> np.ndarray:
        """sqrt(K / m) of the stiffest surface and the lightest mass times a drift, shape (n,)."""
        lightest = largest(1.0 / strip.fields["masses"], strip.masses)
        return np.sqrt(scene.stiffest_surface * lightest) * self.spans(levels)

    def refused(
        self, strip: Strip, scene: Scene, levels: np.ndarray, substeps: np.ndarray | None = None
    ) -> np.ndarray:
        """Robots that these steps cannot simulate, shape (n,) bool; with sub-steps, if known."""
        refused = certainly_unstable(strip, self.dt / 2.0**levels, self.integrator)
        if not scene.stiffest_surface:
            return refused
        phase = self._contact_phase(strip, scene, levels)
        phase /= self.substeps(strip, scene, levels) if substeps is None else substeps
        chosen = self.integrator != "euler" and self.contact_substeps is None
        return refused | (phase > (LARGEST_CONTACT_PHASE if chosen else 2.0))

    def spans(self, levels: np.ndarray) -> np.ndarray:
        """Duration of a drift of each robot [s], shape (n,)."""
        return self.dt / 2.0**levels / DRIFTS[self.integrator]

    def constants(self, scene: Scene) -> np.ndarray:
        """The constants of the kernels, a row for each level."""
        rows = [
            constants(scene, self.dt / 2**level, self.integrator, self.limits)
            for level in range(LEVELS + 1 if self.auto else 1)
        ]
        return np.array(rows)
