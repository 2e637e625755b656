"""C++ by ctypes: the plain program, and the hand-tuned limit of the processor."""

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
from pathlib import Path

import numpy as np

from peers.problem import Problem

__all__ = ["PROGRAMS", "Limit", "Plain", "build", "versions"]

SOURCES = Path(__file__).parents[1] / "cpp"
FLAGS = ("-std=c++17", "-O3", "-march=native", "-fopenmp", "-shared", "-fPIC", "-w")
#: Older compilers schedule for processors that split 512 bits in halves where they do not know the
#: one they run on; it need not.
TUNING = ("-mtune=icelake-server",) if platform.machine() in ("x86_64", "AMD64") else ()
#: The limit knows that no square root is of a negative number.
EXTRA_FLAGS = {"limit": ("-fno-math-errno", *TUNING), "plain": ()}

DOUBLES = ("masses", "positions", "velocities", "stiffness", "rest_length", "amplitude", "phase")


class _Problem(ctypes.Structure):
    """The mirror of ``cpp/problem.h``."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("robots", "n_masses", "n_springs")),
        ("ends", ctypes.c_void_p),
        *((name, ctypes.c_void_p) for name in (*DOUBLES, "omega")),
        ("gravity", ctypes.c_double * 3),
        *((name, ctypes.c_double) for name in ("dt", "keep", "ground_stiffness")),
        *((name, ctypes.c_double) for name in ("static_friction", "kinetic_friction")),
        ("threads", ctypes.c_int64),
    )


def compiler() -> str:
    """The C++ compiler: ``$CXX``, or g++, or clang++."""
    found = os.environ.get("CXX") or shutil.which("g++") or shutil.which("clang++")
    if found is None:
        raise RuntimeError("no C++ compiler: neither g++ nor clang++ is installed")
    return found


def build(name: str, flags: tuple[str, ...] = ()) -> Path:
    """Compile ``cpp/NAME.cpp`` unless a library of just these sources and flags is there.

    Returns:
        The shared library, in ``benchmarks/peers/.cache/cpp``.

    Raises:
        RuntimeError: There is no compiler, or it fails.
    """
    flags = (*FLAGS, *EXTRA_FLAGS[name], *flags)
    digest = hashlib.sha256(" ".join([compiler(), *flags]).encode())
    for source in (SOURCES / f"{name}.cpp", *sorted(SOURCES.glob("*.h"))):
        digest.update(source.read_bytes())
    library = SOURCES.parent / ".cache" / "cpp" / f"{name}_{digest.hexdigest()[:12]}.so"
    if not library.exists():
        library.parent.mkdir(parents=True, exist_ok=True)
        command = [compiler(), *flags, str(SOURCES / f"{name}.cpp"), "-o", str(library)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr}")
    return library


class _Compiled:
    """A simulation in one of the libraries."""

    name: str
    flags: tuple[str, ...] = ()

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        library = ctypes.CDLL(str(build(self.name, self.flags)))
        arrays = {name: np.ascontiguousarray(getattr(problem, name)) for name in DOUBLES}
        arrays |= {"ends": problem.springs, "omega": problem.omega}
        numbers = ("dt", "keep", "ground_stiffness", "static_friction", "kinetic_friction")
        given = _Problem(
            robots=problem.n_robots,
            n_masses=problem.n_masses,
            n_springs=problem.n_springs,
            gravity=(ctypes.c_double * 3)(*problem.gravity),
            threads=threads,
            **{name: array.ctypes.data for name, array in arrays.items()},
            **{name: getattr(problem, name) for name in numbers},
        )
        create = getattr(library, f"create_{precision}")
        create.restype = ctypes.c_void_p
        self._simulation = ctypes.c_void_p(create(ctypes.byref(given)))
        self._run = getattr(library, f"run_{precision}")
        self._read = getattr(library, f"positions_{precision}")
        self._destroy = getattr(library, f"destroy_{precision}")
        self._shape = problem.positions.shape

    def run(self, steps: int) -> None:
        """Step all robots."""
        self._run(self._simulation, ctypes.c_int64(steps))

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        out = np.empty(self._shape)
        self._read(self._simulation, ctypes.c_void_p(out.ctypes.data))
        return out

    def __del__(self) -> None:
        if hasattr(self, "_destroy"):
            self._destroy(self._simulation)


class Plain(_Compiled):
    """One robot at a time."""

    name = "plain"


class Limit(_Compiled):
    """Robots as lanes, tuned by hand."""

    name = "limit"


PROGRAMS = {"C++ plain": Plain, "C++ limit": Limit}


def versions() -> dict[str, str]:
    """The compiler and its version."""
    said = subprocess.run([compiler(), "--version"], capture_output=True, text=True, check=True)
    return {Path(compiler()).name: said.stdout.splitlines()[0].split()[-1]}
