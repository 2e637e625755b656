"""Optimizers: ask for candidates, tell their scores.

An optimizer is one file and one line in `OPTIMIZERS`; its name there is its name in a run's
configuration.
"""

from __future__ import annotations

from evolve.optimizers.age_fitness import AgeFitness, AgeFitnessSettings
from evolve.optimizers.base import NOBODY, Candidates, Individuals, Optimizer, OptimizerSettings
from evolve.optimizers.cma_es import CmaEs, CmaEsSettings
from evolve.optimizers.coevolution import Coevolution, CoevolutionSettings
from evolve.optimizers.crowding import CrowdingSettings, DeterministicCrowding
from evolve.optimizers.genetic import GeneticAlgorithm, GeneticSettings
from evolve.optimizers.hill_climber import HillClimber, HillClimberSettings
from evolve.optimizers.learning import Learning, LearningSettings
from evolve.optimizers.map_elites import MapElites, MapElitesSettings
from evolve.optimizers.novelty import Novelty, NoveltySettings
from evolve.optimizers.nsga2 import Nsga2, Nsga2Settings
from evolve.optimizers.random_search import RandomSearch, RandomSettings
from evolve.optimizers.speciation import Speciation, SpeciationSettings
from evolve.optimizers.steady_state import SteadyState, SteadyStateSettings

__all__ = [
    "NOBODY",
    "OPTIMIZERS",
    "AgeFitness",
    "AgeFitnessSettings",
    "Candidates",
    "CmaEs",
    "CmaEsSettings",
    "Coevolution",
    "CoevolutionSettings",
    "CrowdingSettings",
    "DeterministicCrowding",
    "GeneticAlgorithm",
    "GeneticSettings",
    "HillClimber",
    "HillClimberSettings",
    "Individuals",
    "Learning",
    "LearningSettings",
    "MapElites",
    "MapElitesSettings",
    "Novelty",
    "NoveltySettings",
    "Nsga2",
    "Nsga2Settings",
    "Optimizer",
    "OptimizerSettings",
    "RandomSearch",
    "RandomSettings",
    "Speciation",
    "SpeciationSettings",
    "SteadyState",
    "SteadyStateSettings",
]

OPTIMIZERS: dict[str, type[Optimizer]] = {
    "random": RandomSearch,
    "hill_climber": HillClimber,
    "genetic": GeneticAlgorithm,
    "steady_state": SteadyState,
    "crowding": DeterministicCrowding,
    "age_fitness": AgeFitness,
    "cma": CmaEs,
    "nsga2": Nsga2,
    "map_elites": MapElites,
    "novelty": Novelty,
    "speciation": Speciation,
    "learning": Learning,
    "coevolution": Coevolution,
}
"""Name in the configuration -> class."""
