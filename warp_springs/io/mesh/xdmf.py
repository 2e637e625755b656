"""XDMF: frames of lines and triangles in one text file that ParaView plays."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

if TYPE_CHECKING:
    import meshio

__all__ = ["write_xdmf"]

_KINDS = {"line": (2, 2), "triangle": (4,)}
"""What XDMF writes before the nodes of a cell of a mixed topology; a line says how many it has."""


def write_xdmf(path: Path, times: Iterable[float], meshes: Iterable[meshio.Mesh]) -> None:
    """Write meshes of one topology, one for each time [s]: the cells once, points for each."""
    with path.open("w", encoding="utf-8") as file:
        file.write('<?xml version="1.0"?>\n<Xdmf Version="3.0">\n<Domain>\n')
        times = list(times)
        if len(times) > 1:
            file.write('<Grid Name="frames" GridType="Collection" CollectionType="Temporal">\n')
        for number, (time, mesh) in enumerate(zip(times, meshes, strict=True)):
            file.write(f'<Grid Name="frame {number}" GridType="Uniform">\n')
            if len(times) > 1:  # some readers know no time outside a collection
                file.write(f'<Time Value="{float(time)!r}"/>\n')
            _write_topology(file, mesh, first=number == 0)
            file.write('<Geometry GeometryType="XYZ">\n')
            _write_item(file, mesh.points)
            file.write("</Geometry>\n")
            for name, values in mesh.point_data.items():
                _write_attribute(file, name, values, "Node")
            for name, parts in mesh.cell_data.items():
                _write_attribute(file, name, np.concatenate(parts), "Cell")
            file.write("</Grid>\n")
        if len(times) > 1:
            file.write("</Grid>\n")
        file.write("</Domain>\n</Xdmf>\n")


def _write_topology(file, mesh: meshio.Mesh, first: bool) -> None:
    count = sum(len(block.data) for block in mesh.cells)
    file.write(f'<Topology TopologyType="Mixed" NumberOfElements="{count}">\n')
    if first:
        rows = [
            np.hstack([np.tile(_KINDS[block.type], (len(block.data), 1)), block.data]).ravel()
            for block in mesh.cells
        ]
        _write_item(file, np.concatenate(rows))
    else:
        where = "/Xdmf/Domain/Grid/Grid[1]/Topology/DataItem[1]"
        file.write(f'<DataItem Reference="XML">{where}</DataItem>\n')
    file.write("</Topology>\n")


def _write_attribute(file, name: str, values: np.ndarray, centre: str) -> None:
    kind = "Scalar" if values.ndim == 1 else "Vector"
    file.write(f'<Attribute Name={quoteattr(name)} AttributeType="{kind}" Center="{centre}">\n')
    _write_item(file, values)
    file.write("</Attribute>\n")


def _write_item(file, values: np.ndarray) -> None:
    whole = values.dtype.kind in "iu"
    kind = f'NumberType="{"Int" if whole else "Float"}" Precision="8"'
    size = " ".join(map(str, values.shape))
    file.write(f'<DataItem {kind} Format="XML" Dimensions="{size}">\n')
    rows = values.reshape(len(values), -1)
    np.savetxt(file, rows, "%d" if whole else "%.17g")
    file.write("</DataItem>\n")
