"""An environment of its own for each library that is compared: pinned, made once, by pip."""

import hashlib
import os
import subprocess
import sys
import venv
from pathlib import Path

__all__ = ["CACHE", "REQUIREMENTS", "python_of"]

CACHE = Path(__file__).parent / ".cache"

#: What each library's programs need; libraries that are not named run in this very environment.
#: The last two draw, for render.py and blender.py.
REQUIREMENTS = {
    "numpy": ("numpy==2.4.6",),
    "numba": ("numba==0.68.1", "numpy==2.4.6"),
    "jax": ("jax==0.10.2", "jaxlib==0.10.2", "numpy==2.4.6"),
    "taichi": ("taichi==1.7.4", "numpy==2.4.6"),
    "newton": ("newton==1.8.0", "warp-lang==1.19.0", "numpy==2.4.6"),
    "pyvista": ("pyvista==0.49.1", "vtk==9.7.2", "numpy==2.4.6"),
    "blender": ("bpy==5.0.1",),
}


def python_of(library: str) -> Path:
    """The interpreter of a library's environment, which is made if it is not there.

    Raises:
        RuntimeError: It cannot be made; with what pip said.
    """
    if library not in REQUIREMENTS:
        return Path(sys.executable)
    wanted = REQUIREMENTS[library]
    digest = hashlib.sha256(repr((sys.version, wanted)).encode()).hexdigest()[:12]
    folder = CACHE / "environments" / f"{library}_{digest}"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    done = folder / "complete"
    if not done.exists():
        venv.create(folder, with_pip=True, clear=True)
        _run([str(python), "-m", "pip", "install", "--quiet", "--no-input", *wanted])
        done.touch()
    return python


def _run(command: list[str]) -> None:
    said = subprocess.run(command, capture_output=True, text=True)
    if said.returncode:
        errors = [line for line in said.stderr.splitlines() if line.startswith("ERROR")]
        raise RuntimeError("; ".join(errors[-2:]) or f"{command[0]} failed: {said.stderr[-300:]}")
