"""Workers on many machines, by Ray (the extra `ray`)."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from evolve.encodings.base import Genomes
from evolve.errors import RunError
from evolve.judging.judge import Ticket
from evolve.judging.scores import Scores
from evolve.judging.workshop import Workshop, chunks, cores

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
        self._idle, self._busy = deque(self._actors), {}
        self._waiting: deque[tuple[list[Scores | None], int, list[bytes]]] = deque()

    def _start(self, config: str, device: str) -> Any:
        """An actor on a device; Ray chooses the machine, and which of its GPUs the actor sees."""
        on_gpu = device.startswith("cuda")
        worker = self._ray.remote(Workshop).options(
            num_cpus=1, num_gpus=int(on_gpu), max_restarts=RESTARTS, max_task_retries=RETRIES
        )
        return worker.remote(config, "cuda:0" if on_gpu else device, 1)

    def submit(self, genomes: Genomes, blobs: Sequence[bytes]) -> Ticket:
        """Begin to simulate n genomes, by their bytes; several may be under way at once."""
        parts = chunks(blobs, len(self._actors))
        answers: list[Scores | None] = [None] * len(parts)
        self._waiting.extend((answers, index, part) for index, part in enumerate(parts))
        self._feed()
        return lambda: self._finished(answers)

    def _feed(self) -> None:
        """Give waiting parts to idle actors."""
        while self._waiting and self._idle:
            (answers, index, part), actor = self._waiting.popleft(), self._idle.popleft()
            self._busy[actor.judge.remote(part)] = answers, index, actor

    def _finished(self, answers: list[Scores | None]) -> Scores:
        while None in answers:
            self._feed()
            (done, *_), _ = self._ray.wait(list(self._busy))
            whose, index, actor = self._busy.pop(done)
            self._idle.append(actor)
            whose[index] = self._answer(done)
        return Scores.concatenate(answers)

    def _answer(self, done: Any) -> Scores:
        """The scores that an actor gave. Arrays that come out of Ray are read-only."""
        try:
            return Scores(*self._ray.get(done))
        except self._ray.exceptions.RayActorError as error:
            self._waiting.clear()
            raise RunError(f"an actor died {RETRIES + 1} times over the same robots") from error
        except self._ray.exceptions.RayTaskError as error:
            self._waiting.clear()
            raise RunError(f"an actor failed: {_cause(error)}") from error

    def prepare(self, genomes: Genomes, blobs: Sequence[bytes]) -> None:
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


def _cause(error: Any) -> str:
    cause = error.cause
    return f"{type(cause).__name__}: {cause}"


def _ray() -> Any:
    try:
        import ray
    except ImportError:
        raise RunError(
            "simulation.cluster needs Ray: install it with pip install 'warp-springs[ray]'"
        ) from None
    return ray
