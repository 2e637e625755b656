"""Workers on many machines, by Ray (the extra `ray`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from evolve.encodings.base import Genomes
from evolve.errors import RunError
from evolve.scores import Scores
from evolve.workshop import Workshop, chunks, cores

if TYPE_CHECKING:
    from evolve.config import RunConfig

__all__ = ["Cluster"]

RESTARTS = 8
"""How often an actor that was killed comes back."""
RETRIES = 3
"""How often a chunk is tried again on another life of its actor."""


class Cluster:
    """Simulates genomes in Ray actors; the scores do not depend on how many there are or on where.

    An actor that is killed comes back, and its chunk is done again.

    Args:
        config: Of the run; `simulation.cluster` is the address of the cluster, "local" for one of
            this machine's own, and `simulation.devices` names the device of each actor.

    Raises:
        RunError: Ray is not installed, the cluster is not there, or it lacks the GPUs.
    """

    def __init__(self, config: RunConfig) -> None:
        from evolve.toml import dump

        settings = config.simulation
        self._ray = ray = _ray()
        self._started = not ray.is_initialized()
        if self._started:
            address = None if settings.cluster == "local" else settings.cluster
            places = {"num_cpus": max(cores(), len(settings.devices))} if address is None else {}
            try:
                ray.init(address, log_to_driver=False, include_dashboard=False, **places)
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise RunError(f"simulation.cluster = {settings.cluster!r}: {error}") from None
        gpus = sum(device.startswith("cuda") for device in settings.devices)
        # An actor that waits for a GPU that nobody has would wait for ever.
        if gpus > (there := ray.cluster_resources().get("GPU", 0)):
            self.close()
            raise RunError(f"the cluster has {there:g} GPUs, simulation.devices asks for {gpus}")
        self._actors = [self._start(dump(config), device) for device in settings.devices]

    def _start(self, config: str, device: str) -> Any:
        """An actor on a device; Ray chooses the machine, and which of its GPUs the actor sees."""
        on_gpu = device.startswith("cuda")
        worker = self._ray.remote(Workshop).options(
            num_cpus=1, num_gpus=int(on_gpu), max_restarts=RESTARTS, max_task_retries=RETRIES
        )
        return worker.remote(config, "cuda:0" if on_gpu else device, 1)

    def __call__(self, genomes: Genomes, blobs: Sequence[bytes]) -> Scores:
        """Scores of n genomes, by their bytes."""
        ray, parts = self._ray, chunks(blobs, len(self._actors))
        waiting, answers = list(enumerate(parts)), {}
        idle, busy = list(self._actors), {}
        while len(answers) < len(parts):
            while waiting and idle:
                (index, part), actor = waiting.pop(0), idle.pop()
                busy[actor.judge.remote(part)] = index, actor
            (done, *_), _ = ray.wait(list(busy))
            index, actor = busy.pop(done)
            answers[index] = self._answer(done)
            idle.append(actor)
        # Arrays that come out of Ray are read-only; scores are never written to.
        return Scores.concatenate([answers[i] for i in range(len(parts))])

    def _answer(self, done: Any) -> Scores:
        try:
            return Scores(*self._ray.get(done))
        except self._ray.exceptions.RayActorError as error:
            raise RunError(f"an actor died {RETRIES + 1} times over the same robots") from error
        except self._ray.exceptions.RayTaskError as error:
            cause = error.cause
            raise RunError(f"an actor failed: {type(cause).__name__}: {cause}") from error

    def prepare(self, blobs: Sequence[bytes]) -> None:
        """Load the kernels in every actor, one after the other: the first may compile them."""
        for actor in self._actors:
            self._ray.get(actor.judge.remote(list(blobs)))

    def close(self) -> None:
        """End the actors, and the local cluster if there was none before."""
        for actor in getattr(self, "_actors", ()):
            self._ray.kill(actor)
        self._actors = []
        if self._started:
            self._ray.shutdown()


def _ray() -> Any:
    try:
        import ray
    except ImportError:
        raise RunError(
            "simulation.cluster needs Ray: install it with pip install 'warp-springs[ray]'"
        ) from None
    return ray
