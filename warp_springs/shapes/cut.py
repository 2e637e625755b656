"""Many bodies of voxels at once, cut from one lattice."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.fields import require_positive
from warp_springs.body.many import many
from warp_springs.geometry import FloatArray, spring_lengths
from warp_springs.robot import Robot
from warp_springs.shapes.voxels import voxel_table

__all__ = ["Cut"]


class Cut:
    """The bodies that `voxels` makes of N masks, all at once: masses, springs, faces, no physics.

    Args:
        masks: Which voxels exist in each body, shape (N, nx, ny, nz), bool.
        edge: Length of a voxel's edge [m].

    Attributes:
        n_masses: Masses of each body, shape (N,).
        n_springs: Springs of each body, shape (N,).
        lengths: Of the springs of all bodies, one body after the other [m], shape (sum,).
        body: To which body each of these springs belongs, shape (sum,).
        sharing: The voxels that contain each of them, whether they exist or not, x-major, in
            ascending order, filled up with the number of voxels; shape (4, sum).

    Raises:
        ValueError: The masks are no boolean array of that shape, one is empty, or the edge is not
            a positive number.
    """

    def __init__(self, masks: ArrayLike, edge: float = 0.1) -> None:
        edge, masks = require_positive("edge", edge), np.asarray(masks)
        if masks.ndim != 4 or masks.dtype != np.bool_ or not len(masks):
            raise ValueError(
                f"masks: {masks.dtype} of shape {masks.shape} given, bool of (N, nx, ny, nz) "
                "expected"
            )
        if not masks.any(axis=(1, 2, 3)).all():
            empty = int(np.argmin(masks.any(axis=(1, 2, 3))))
            raise ValueError(f"masks[{empty}]: no voxel is set")
        n, table = len(masks), voxel_table(masks.shape[1:])
        # A row for each voxel, and one for the outside, which is never present.
        present = np.zeros((masks[0].size + 1, n), bool)
        present[:-1] = masks.reshape(n, -1).T

        vertices = _any_of(present, table.vertex_voxels)
        number = (np.cumsum(vertices, axis=1, dtype=np.int32) - 1).ravel()
        row, vertex = np.nonzero(vertices)
        height = np.where(vertices, table.grid[:, 2], np.inf).min(axis=1)
        grid = table.grid[vertex]
        grid[:, 2] -= height[row]
        self._positions = grid * edge
        self.n_masses = np.bincount(row, minlength=n)

        self.body, kind = np.nonzero(_any_of(present, table.edge_voxels))
        self.n_springs = np.bincount(self.body, minlength=n)
        self.sharing = table.edge_voxels[:, kind]
        first = self.body * len(table.grid)
        self._springs = number[first[:, None] + table.edges[kind]]
        start = (np.cumsum(self.n_masses) - self.n_masses)[self.body]
        self.lengths: FloatArray = spring_lengths(self._positions, self._springs + start[:, None])

        inside, outside = table.quad_voxels
        row, quad = np.nonzero((present[inside] & ~present[outside]).T)
        corners = number[(row * len(table.grid))[:, None] + table.quads[quad]]
        self._faces = corners.reshape(-1, 3)
        self._n_faces = 2 * np.bincount(row, minlength=n)

    def robots(
        self, masses: ArrayLike, stiffness: ArrayLike, omega: float = 0.0, **springs: Any
    ) -> list[Robot]:
        """The robots of these bodies, at rest.

        Args:
            masses: Of the points of each body [kg], shape (N,).
            stiffness: Of the springs of all bodies [N/m], shape (sum,).
            omega: Angular frequency of the actuation [rad/s].
            springs: ``amplitude`` [m] and ``phase`` [rad], likewise.

        Raises:
            ValueError: An array is malformed.
        """
        counts = {"mass": self.n_masses, "spring": self.n_springs, "face": self._n_faces}
        fields = {
            "masses": np.repeat(np.asarray(masses, np.float64), self.n_masses),
            "positions": self._positions,
            "springs": self._springs,
            "stiffness": stiffness,
            "rest_length": self.lengths,
            "faces": self._faces,
        }
        return many(counts, fields | springs, omega)


def _any_of(present: np.ndarray, voxels_of: np.ndarray) -> np.ndarray:
    """Whether any of the voxels in each column is in each body, (V + 1, N), (K, E) -> (N, E)."""
    found = present[voxels_of[0]]
    for more in voxels_of[1:]:
        found |= present[more]
    return np.ascontiguousarray(found.T)
