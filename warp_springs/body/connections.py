"""The springs of a body, and the key by which bodies of one topology are known."""

from __future__ import annotations

import hashlib
from functools import cached_property

from warp_springs.geometry import IntArray

__all__ = ["Connections"]


class Connections:
    """The springs of one body, shared by all robots derived from it, with their key."""

    def __init__(self, n_masses: int, springs: IntArray) -> None:
        self.n_masses, self.springs = n_masses, springs

    @cached_property
    def key(self) -> bytes:
        """Hash of the number of masses and of the springs in their order."""
        digest = hashlib.blake2b(self.springs.tobytes(), digest_size=16)
        digest.update(self.n_masses.to_bytes(8, "little"))
        return digest.digest()
