"""Robots as files: one ``.npz`` with everything that a robot is.

The file is a zip of NumPy arrays, readable with ``numpy.load``:

``header``
    One JSON text as bytes: ``format`` is ``"warp_springs robot"``, ``version`` that of this
    layout, ``warp_springs`` the version that wrote it, and ``materials``, ``elements`` and
    ``objects`` trees as in the files of results (`warp_springs.io.results`).
``masses``, ``positions``, ``velocities``, ``springs``, ``stiffness``, ``rest_length``, ...
    The fields of `Robot`, shapes and units as there; ``omega`` is one number.
``pool/DTYPE``
    The arrays of the elements, those of one type raveled one after the other.

Nothing in a file is executed.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from warp_springs.body.fields import FIELDS
from warp_springs.io.outputs import checked_output, written_beside
from warp_springs.io.trees import Reader, Writer, check_header
from warp_springs.robot import Robot

__all__ = ["load_robot", "save_robot"]

FORMAT = "warp_springs robot"
VERSION = 1
ARRAYS = tuple(name for name, field in FIELDS.items() if field.rule != "table")


def save_robot(robot: Robot, path: str | os.PathLike[str]) -> Path:
    """Write a robot; see `Robot.save`."""
    from warp_springs import __version__

    path = checked_output(path, (".npz",))
    writer = Writer()
    header = {
        "format": FORMAT,
        "version": VERSION,
        "warp_springs": __version__,
        "materials": writer.tree(robot.materials, "materials"),
        "elements": writer.tree(robot.elements, "elements"),
        "objects": writer.objects,
    }
    arrays = {name: np.asarray(getattr(robot, name)) for name in ARRAYS}
    arrays |= {f"pool/{dtype}": pool for dtype, pool in writer.pools().items()}
    with written_beside(path) as draft:
        np.savez_compressed(draft, header=np.array(json.dumps(header).encode()), **arrays)
    return path


def load_robot(path: str | os.PathLike[str]) -> Robot:
    """Read a robot; see `Robot.load`."""
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            header = json.loads(file["header"].item())
            check_header(header, FORMAT, VERSION)
            pools = {name[5:]: file[name] for name in file.files if name.startswith("pool/")}
            reader = Reader(pools, header["objects"])
            return Robot(
                **{name: file[name] for name in ARRAYS},
                materials=reader.value(header["materials"]),
                elements=reader.value(header["elements"]),
            )
    except OSError:
        raise
    except Exception as error:  # whatever a damaged file makes of its contents
        words = " ".join(str(error).split())
        raise ValueError(f"{path}: this is no readable robot file ({words})") from error
