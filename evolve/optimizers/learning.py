"""Learning: every new body is tried with several controllers before it has to compete."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Encoding, Genomes
from evolve.optimizers.age_fitness import AgeFitness, AgeFitnessSettings
from evolve.optimizers.base import Candidates, Individuals, Optimizer, OptimizerSettings, Recall
from evolve.optimizers.crowding import CrowdingSettings, DeterministicCrowding
from evolve.optimizers.genetic import GeneticAlgorithm, GeneticSettings
from evolve.optimizers.map_elites import MapElites, MapElitesSettings
from evolve.optimizers.novelty import Novelty, NoveltySettings
from evolve.optimizers.nsga2 import Nsga2, Nsga2Settings
from evolve.optimizers.speciation import Speciation, SpeciationSettings
from evolve.streams import Role, Streams

__all__ = ["Learning", "LearningSettings"]

OUTER: tuple[type[Optimizer], ...] = (
    AgeFitness, GeneticAlgorithm, Novelty, Speciation, MapElites, Nsga2, DeterministicCrowding,
)  # fmt: skip
"""Who may search for bodies."""

AnyOuter = (
    AgeFitnessSettings
    | GeneticSettings
    | NoveltySettings
    | SpeciationSettings
    | MapElitesSettings
    | Nsga2Settings
    | CrowdingSettings
)


class LearningSettings(OptimizerSettings):
    """How long a body may learn, and who searches for bodies."""

    type: Literal["learning"] = "learning"
    tries: int = Field(4, ge=2)
    """Controllers that a body is tried with in a generation."""
    lessons: int = Field(2, ge=1)
    """Generations that a body learns: in each it is tried with variants of its best controller so
    far, and keeps the best. Only then it competes with others."""
    bodies: Annotated[AnyOuter, Field(discriminator="type")] = AgeFitnessSettings()
    """The optimizer that searches for bodies, and its settings."""

    @property
    def measures(self) -> tuple[str, ...]:
        """What the search for bodies looks at."""
        return self.bodies.measures

    @property
    def niches(self) -> tuple[str, ...]:
        """By which the search for bodies tells them apart."""
        return self.bodies.niches


class Learning(Optimizer):
    """Body and controller at different rates: an inner search of controllers for every body.

    A generation of n candidates is n / tries bodies with as many controllers each; every one of
    them is simulated, recorded and counted. After its last lesson a body competes with the best
    controller that it had, which its children inherit. An optimizer of its own searches for bodies;
    it sees nothing but those.
    """

    Settings: ClassVar[type[OptimizerSettings]] = LearningSettings

    settings: LearningSettings

    def __init__(self, encoding: Encoding, streams: Streams, settings: Any) -> None:
        super().__init__(encoding, streams, settings)
        if not hasattr(encoding, "tune"):
            raise ValueError("learning: this encoding cannot vary a controller without its body")
        outer = next(cls for cls in OUTER if isinstance(settings.bodies, cls.Settings))
        self.bodies = outer(encoding, streams, settings.bodies)
        """The optimizer that searches for bodies."""
        self._pupils: Individuals | None = None  # each body with its best controller so far
        self._lesson = 0  # how many they have had

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        if self._pupils is None:
            young = self.bodies.ask(max(1, n // self.settings.tries))
            whose = self._whose(n, len(young))
            genomes = self.encoding.take(young.genomes, whose)
            # A body is tried as it was born, too.
            return self._tuned(genomes, np.arange(n) >= len(young)), young.parents[whose]
        whose = self._whose(n, len(self._pupils))
        genomes = self.encoding.take(self._pupils.genomes, whose)
        parents = np.stack([self._pupils.ids[whose], np.full(n, -1)], axis=1)
        return self._tuned(genomes, np.ones(n, bool)), parents

    def _tuned(self, genomes: Genomes, which: np.ndarray) -> Genomes:
        """The genomes, some of them, (n,) bool, with other controllers."""
        others = self.encoding.tune(genomes, self.streams(self.turn, Role.MUTATION, 2))
        rows = np.flatnonzero(~which)
        self.encoding.overwrite(others, rows, genomes, rows)
        return others

    def _tell(self, individuals: Individuals) -> None:
        pupils = self._pupils
        count = max(1, len(individuals) // self.settings.tries) if pupils is None else len(pupils)
        whose = self._whose(len(individuals), count)
        # The last of each body in this order is its best; of equals, the older.
        ranked = np.lexsort((-individuals.ids, individuals.scores.worth, whose))
        best = ranked[np.append(whose[ranked][1:] != whose[ranked][:-1], True)]
        found = self._take(individuals, best)
        if pupils is not None:
            better = np.arange(count) + count * (found.scores.worth > pupils.scores.worth)
            found = self._take(self._joined(pupils, found), better)
        self._pupils, self._lesson = found, self._lesson + 1
        if self._lesson == self.settings.lessons:
            self._graduate()

    def _graduate(self) -> None:
        """Let the bodies compete, and begin with new ones."""
        found = self._pupils
        nobody = np.full((len(found), 2), -1)  # whom they descend from was said when they were born
        self.bodies.tell(Candidates(found.ids, found.genomes, nobody), found.scores)
        self._pupils, self._lesson = None, 0

    def _whose(self, n: int, bodies: int) -> np.ndarray:
        """Which body each of n candidates has, shape (n,)."""
        return np.arange(n) % bodies

    def _state(self) -> dict[str, np.ndarray]:
        inner = {f"bodies.{name}": value for name, value in self.bodies.state().items()}
        ids = [] if self._pupils is None else self._pupils.ids
        return {
            "pupils": np.array(ids, dtype=np.int64),
            "lesson": np.array([self._lesson], dtype=np.int64),
            **inner,
        }

    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        ids, self._lesson = state["pupils"], int(state["lesson"][0])
        self._pupils = recall(ids) if len(ids) else None
        inner = {
            name.removeprefix("bodies."): value
            for name, value in state.items()
            if name.startswith("bodies.")
        }
        self.bodies.restore(inner, recall)
