"""The libraries' processes: started in their environments, asked one after the other."""

import contextlib
import json
import os
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from peers.environments import CACHE, python_of

__all__ = ["LIBRARIES", "Fleet", "Program", "cores"]

HERE = Path(__file__).parent
LIBRARIES = ("warp_springs", "cpp", "taichi", "numba", "jax", "numpy", "warp", "newton")


@dataclass(frozen=True)
class Program:
    """A program that takes part, on so many threads.

    Attributes:
        name: Its name, with the library's.
        library: Whose it is.
        threads: Threads it runs on.
        process: Threads of the process that it is in.
        precisions: Precisions it has.
        differs: How its physics differs from the others', or nothing.
    """

    name: str
    library: str
    threads: int
    process: int
    precisions: tuple[str, ...]
    differs: str


@dataclass
class Fleet:
    """A process for each library and number of threads.

    Attributes:
        programs: Those that take part.
        versions: On what they stand: name -> version.
        failed: Why libraries do not take part: library -> reason.
    """

    programs: list[Program] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._processes = {}

    def start(self, libraries, threads: list[int], say: Callable[[str], None]) -> None:
        """Set up the environments and start the processes; what fails is noted, the rest go on."""
        for library in libraries:
            say(f"preparing {library}")
            try:
                python = python_of(library)
                for count in threads:
                    self._join(library, count, python)
            except (OSError, RuntimeError) as error:
                self.failed[library] = str(error)
                self.programs = [p for p in self.programs if p.library != library]

    def _join(self, library: str, threads: int, python: Path) -> None:
        self._processes[library, threads] = _spawn(library, threads, python)
        said = self._say(library, threads, do="describe")
        self.versions |= said["versions"]
        for name, facts in said["programs"].items():
            used = min(threads, facts["most_threads"] or threads)
            if not any(p.name == name and p.threads == used for p in self.programs):
                has = tuple(facts["precisions"]), facts["differs"]
                self.programs.append(Program(name, library, used, threads, *has))

    def ask(self, program: Program, do: str, **request) -> dict:
        """What the program's process answers.

        Raises:
            RuntimeError: It failed; with what it said.
        """
        return self._say(program.library, program.process, do=do, program=program.name, **request)

    def drop(self) -> None:
        """Have all processes forget their programs; one that has ended has."""
        for key in self._processes:
            with contextlib.suppress(RuntimeError):
                self._say(*key, do="drop")

    def _say(self, library: str, threads: int, **request) -> dict:
        process = self._processes[library, threads]
        try:
            process.stdin.write(json.dumps(request) + "\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            raise RuntimeError(f"its process ended; see {_log(library, threads)}")
        answer = json.loads(line)
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer

    def stop(self) -> None:
        """End all processes."""
        for process in self._processes.values():
            with contextlib.suppress(BrokenPipeError):
                process.stdin.close()
            process.stdout.close()
        for process in self._processes.values():
            process.wait()


def cores() -> list[int]:
    """The processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def _log(library: str, threads: int) -> Path:
    return CACHE / "logs" / f"{library}_{threads}.txt"


def _spawn(library: str, threads: int, python: Path) -> subprocess.Popen:
    """A process that may use so many cores, with every library's own setting saying so too."""
    names = ("OMP", "NUMBA", "OPENBLAS", "MKL")
    variables = {f"{name}_NUM_THREADS": str(threads) for name in names}
    # Threads that wait must not spin: they would take a core from whoever is measured next.
    variables |= {"OMP_WAIT_POLICY": "passive", "PYTHONPATH": str(HERE.parent)}
    log = _log(library, threads)
    log.parent.mkdir(parents=True, exist_ok=True)
    command = [str(python), "-m", "peers.worker", library, str(threads)]
    allowed = cores()[:threads]

    def pin() -> None:
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, allowed)

    with log.open("w") as errors:
        return subprocess.Popen(
            command,
            env=os.environ | variables,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            preexec_fn=pin if os.name == "posix" else None,
        )
