"""Results as files: everything a run hands back in one ``.npz``, read back lazily.

The file is an uncompressed zip of NumPy arrays, readable with ``numpy.load``:

``header``
    One JSON text, ASCII. ``format`` is ``"warp_springs result"``, ``version`` that of this layout,
    ``warp_springs`` the version that wrote it, ``masses`` how many each robot has, ``result`` the
    public fields of `Result`, ``objects`` the robots and data classes in them, each once and before
    whatever holds it: ``{"type": name, "fields": {...}}``, or ``"arguments"`` for robots. A tuple
    is ``{"tuple": [...]}``, a dict ``{"dict": [[key, value], ...]}``, an object
    ``{"object": index}``, an array ``{"array": [dtype, first, shape]}``: so many values, from
    ``first`` on, of the pool of its type.
``pool/DTYPE``
    All arrays of one type (``float64``, ``int32``, ...), raveled, one after the other.
``positions``, ``velocities``
    At the end [m, m/s], shape (M of all robots together, 3), float64, robot by robot.
``frames/INDEX``
    Recorded positions of a robot [m], shape (F, M, 3), float64.
``worn/INDEX``, ``flowed/INDEX``
    Of a robot whose springs may break or yield: when they broke [s] and how far they had flowed in
    the end [m], shape (2, S); and in each frame [m], shape (F, S).
``signals/INDEX``, ``heard/INDEX``
    Of a robot with controllers: their outputs in the end, and in each frame, shape (F, outputs).

Nothing in a file is executed. Frames stay on the disk until they are asked for.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import struct
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from warp_springs.io.outputs import checked_output, written_beside
from warp_springs.io.trees import Reader, Writer, check_header

if TYPE_CHECKING:
    from warp_springs.result import Result

__all__ = ["load_result", "save_result"]

FORMAT = "warp_springs result"
VERSION = 1
_SUFFIXES = (".npz",)
_BY_ROBOT = ("worn", "flowed", "signals", "heard")
"""What is kept of some robots only: folders of a file, and private fields of a result."""
_ZIP_HEADER = 30
"""Bytes before the name of an entry; the last four say how long the name and its extras are."""
_READ_HEADER = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_BATCH = 1024
"""Robots whose last state is held in memory at once while a file is written."""


def save_result(result: Result, path: str | os.PathLike[str]) -> Path:
    """Write a result; see `Result.save`."""
    from warp_springs import __version__

    path = checked_output(path, _SUFFIXES)
    writer = Writer()
    public = [f.name for f in dataclasses.fields(result) if not f.name.startswith("_")]
    header = {
        "format": FORMAT,
        "version": VERSION,
        "warp_springs": __version__,
        "masses": [len(result.positions(i)) for i in range(len(result))],
        "result": {name: writer.tree(getattr(result, name), name) for name in public},
        "objects": writer.objects,
    }
    with written_beside(path) as draft, zipfile.ZipFile(draft, "w", zipfile.ZIP_STORED) as file:
        _write(file, "header", np.array(json.dumps(header).encode()))
        for dtype, pool in writer.pools().items():
            _write(file, f"pool/{dtype}", pool)
        for name in ("positions", "velocities"):
            _write_states(file, name, getattr(result, name), header["masses"])
        for index in result.recorded:
            _write(file, f"frames/{index}", np.asarray(result.frames(index), np.float64))
        for name in _BY_ROBOT:
            for index, values in getattr(result, f"_{name}").items():
                _write(file, f"{name}/{index}", values)
    return path


def load_result(path: str | os.PathLike[str]) -> Result:
    """Read a result; see `Result.load`."""
    from warp_springs.result import Result

    path = Path(path)
    try:
        entries = _entries(path)
        header = json.loads(entries["header"].item())
        check_header(header, FORMAT, VERSION)
        pools = {name[5:]: array for name, array in entries.items() if name.startswith("pool/")}
        reader = Reader(pools, header["objects"])
        fields = {name: reader.value(tree) for name, tree in header["result"].items()}
        masses = header["masses"]
        return Result(
            **fields,
            _slots=_Rows(masses),
            _positions=entries["positions"],
            _velocities=entries["velocities"],
            _frames={index: entries[f"frames/{index}"] for index in fields["recorded"]},
            **{f"_{name}": _by_robot(entries, name) for name in _BY_ROBOT},
        )
    except OSError:
        raise
    except Exception as error:  # whatever a damaged file makes of its contents
        raise ValueError(f"{path}: this is no readable result file ({error})") from error


def _by_robot(entries: dict[str, np.ndarray], name: str) -> dict[int, np.ndarray]:
    """What the file holds of some robots, by their index."""
    keys = [key.partition("/") for key in entries]
    return {int(i): entries[f"{name}/{i}"] for kind, _, i in keys if kind == name}


class _Rows:
    """Where each robot's block is in an array of all masses: what `Result` asks for its states."""

    def __init__(self, masses: Sequence[int]) -> None:
        self._ends = np.cumsum([0, *masses])

    def unpack(self, buffer: np.ndarray, robot: int) -> np.ndarray:
        """Block (M, 3) of one robot, float64."""
        return np.array(buffer[self._ends[robot] : self._ends[robot + 1]])


def _write(file: zipfile.ZipFile, name: str, array: np.ndarray) -> None:
    with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
        np.lib.format.write_array(entry, np.ascontiguousarray(array), allow_pickle=False)


def _write_states(file: zipfile.ZipFile, name: str, of, masses: Sequence[int]) -> None:
    """The states of all robots as one array, never held whole."""
    description = {"descr": "<f8", "fortran_order": False, "shape": (sum(masses), 3)}
    with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
        np.lib.format.write_array_header_1_0(entry, description)
        for first in range(0, len(masses), _BATCH):
            robots = range(first, min(first + _BATCH, len(masses)))
            block = np.concatenate([of(i) for i in robots])
            entry.write(block.astype("<f8", copy=False).tobytes())


def _entries(path: Path) -> dict[str, np.ndarray]:
    """Every array of the file by its name, mapped from the disk and not read yet."""
    with path.open("rb") as raw, zipfile.ZipFile(raw) as file:
        return {
            info.filename.removesuffix(".npy"): _mapped(raw, path, info) for info in file.infolist()
        }


def _mapped(raw: BinaryIO, path: Path, info: zipfile.ZipInfo) -> np.ndarray:
    if info.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{info.filename} is compressed")
    raw.seek(info.header_offset + _ZIP_HEADER - 4)
    raw.seek(sum(struct.unpack("<HH", raw.read(4))), os.SEEK_CUR)  # its name, and more
    shape, fortran, dtype = _READ_HEADER[np.lib.format.read_magic(raw)](raw)
    if dtype.hasobject or fortran:
        raise ValueError(f"{info.filename} holds {dtype}, expected plain numbers")
    if math.prod(shape) == 0:  # nothing can be mapped
        return np.zeros(shape, dtype)
    return np.asarray(np.memmap(path, dtype, "r", raw.tell(), shape))
