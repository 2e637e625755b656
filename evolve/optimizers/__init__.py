"""Optimizers: ask for candidates, tell their scores.

An optimizer is one file and one line in `OPTIMIZERS`; its name there is its name in a run's
configuration.
"""

from __future__ import annotations

from evolve.optimizers.base import NOBODY, Candidates, Individuals, Optimizer, OptimizerSettings
from evolve.optimizers.genetic import GeneticAlgorithm, GeneticSettings
from evolve.optimizers.hill_climber import HillClimber, HillClimberSettings
from evolve.optimizers.random_search import RandomSearch, RandomSettings

__all__ = [
    "NOBODY",
    "OPTIMIZERS",
    "Candidates",
    "GeneticAlgorithm",
    "GeneticSettings",
    "HillClimber",
    "HillClimberSettings",
    "Individuals",
    "Optimizer",
    "OptimizerSettings",
    "RandomSearch",
    "RandomSettings",
]

OPTIMIZERS: dict[str, type[Optimizer]] = {
    "random": RandomSearch,
    "hill_climber": HillClimber,
    "genetic": GeneticAlgorithm,
}
"""Name in the configuration -> class."""
