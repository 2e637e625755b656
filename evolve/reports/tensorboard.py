"""The course of a run for TensorBoard (the extra `tensorboard`)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from evolve.errors import RunError
from evolve.run import Progress, Run

__all__ = ["FOLDER", "Curves"]

FOLDER = "tensorboard"
"""In the folder of a run: where its event files are."""


class Curves:
    """Writes what `Progress` says, after each generation; a context that ends with the run.

    Args:
        runs: What is evolved together.

    Raises:
        RunError: tensorboardX is not installed.
    """

    def __init__(self, runs: Sequence[Run]) -> None:
        try:
            from tensorboardX import SummaryWriter
        except ImportError:
            raise RunError(
                "--tensorboard needs tensorboardX: pip install 'warp-springs[tensorboard]'"
            ) from None
        self._writers = [SummaryWriter(str(run.directory / FOLDER)) for run in runs]

    def __enter__(self) -> Curves:
        return self

    def __exit__(self, *_: object) -> None:
        for writer in self._writers:
            writer.close()

    def update(self, progress: Progress, which: int = 0) -> None:
        """Take note of a generation of one of the runs; the abscissa is its evaluations."""
        if not progress.evaluations:
            return
        values = {
            "fitness/best": progress.best_fitness,
            "fitness/median": progress.median,
            "robots/without_fitness": progress.failures,
            "speed/springs_per_second": progress.springs_per_second,
        }
        for name, value in values.items():
            if math.isfinite(value):
                self._writers[which].add_scalar(name, value, progress.evaluations)
