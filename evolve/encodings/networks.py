"""Networks of evolving topology, whole populations of them in one array."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydantic import Field

from evolve.encodings.base import EncodingSettings, folded

__all__ = ["FUNCTIONS", "NetworkSettings", "Networks"]

FUNCTIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "identity": lambda x: x,
    "sine": lambda x: np.sin(np.pi * x),
    "gaussian": lambda x: 2.0 * np.exp(-np.minimum(x * x, 700.0)) - 1.0,
    "tanh": np.tanh,
    "absolute": np.abs,
    "step": np.sign,
}
"""What a node may make of the sum of its inputs."""

REACH = 4.0
"""Weights lie between minus and plus this."""


class NetworkSettings(EncodingSettings):
    """How far a network may grow, and how often its structure changes."""

    hidden: int = Field(12, ge=0, le=64)
    """Most hidden nodes; a network begins without any."""
    add_node: float = Field(0.1, ge=0.0, le=1.0)
    """Share of the mutations that split a connection by a new node."""
    add_connection: float = Field(0.15, ge=0.0, le=1.0)
    """Share of the mutations that add a connection."""
    drop_connection: float = Field(0.05, ge=0.0, le=1.0)
    """Share of the mutations that remove a connection."""


class Networks:
    """Feed-forward networks of `inputs`, up to `hidden` nodes and `outputs`.

    A network may use any of the H hidden places; place h reads the inputs and the places before
    it, an output reads everything. The place of a node is its historical mark, as in NEAT (Stanley
    and Miikkulainen 2002): crossing over aligns connections by the places that they join.

    A genome has shape (2 T J + T,), float32, in [0, 1], with T = H + outputs targets and
    J = inputs + H sources: weights (T, J), whether each connection exists (T, J), and the function
    of each target.
    """

    def __init__(
        self, inputs: int, hidden: int, outputs: int, mutation_rate: float, mutation_step: float
    ) -> None:
        self.inputs, self.hidden, self.outputs = inputs, hidden, outputs
        self.rate, self.step = mutation_rate, mutation_step
        self.shape = (hidden + outputs, inputs + hidden)
        self.genome_shape = (2 * self.shape[0] * self.shape[1] + self.shape[0],)
        target, source = np.indices(self.shape)
        self.allowed = source < inputs + np.minimum(target, hidden)
        """Connections that a network may have, shape (T, J)."""

    def parts(self, genomes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Weights (n, T, J), which connections exist (n, T, J) bool, functions (n, T)."""
        size = self.shape[0] * self.shape[1]
        weights = genomes[:, :size].reshape(-1, *self.shape)
        exists = (genomes[:, size : 2 * size] >= 0.5).reshape(-1, *self.shape) & self.allowed
        count = len(FUNCTIONS)
        functions = np.minimum((genomes[:, 2 * size :] * count).astype(np.int64), count - 1)
        return (2.0 * weights - 1.0) * REACH, exists, functions

    def _joined(self, weights: np.ndarray, exists: np.ndarray, functions: np.ndarray) -> np.ndarray:
        """Genomes from weight genes, connections and function genes."""
        n = len(weights)
        flat = [weights.reshape(n, -1), exists.reshape(n, -1), functions]
        return np.concatenate(flat, axis=1).astype(np.float32)

    def _genes(self, genomes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Copies of weight genes, connections and function genes."""
        size = self.shape[0] * self.shape[1]
        weights = genomes[:, :size].reshape(-1, *self.shape).copy()
        return weights, self.parts(genomes)[1].copy(), genomes[:, 2 * size :].copy()

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n networks without hidden nodes, each output with half of the inputs, on average."""
        weights = rng.standard_normal((n, *self.shape), dtype=np.float32) * (0.5 / REACH) + 0.5
        exists = np.zeros((n, *self.shape), bool)
        exists[:, self.hidden :, : self.inputs] = rng.random((n, self.outputs, self.inputs)) < 0.5
        functions = rng.random((n, self.shape[0]), dtype=np.float32)
        return self._joined(folded(weights), exists, functions)

    def mutate(
        self,
        genomes: np.ndarray,
        rng: np.random.Generator,
        add_node: float,
        add_connection: float,
        drop_connection: float,
    ) -> np.ndarray:
        """Change the structure of some networks, and weights and functions of all others."""
        n = len(genomes)
        weights, exists, functions = self._genes(genomes)
        dice = rng.random(n)
        bounds = np.cumsum([add_node, add_connection, drop_connection])
        kind = np.searchsorted(bounds, dice, side="right")  # 0, 1, 2, or 3: none of them
        for row in np.flatnonzero(kind == 0):
            if not self._split(weights[row], exists[row], functions[row], rng):
                kind[row] = 3
        for row in np.flatnonzero(kind == 1):
            free = np.flatnonzero(self.allowed & ~exists[row] & self._live(exists[row]))
            if len(free):
                exists[row].flat[free[rng.integers(len(free))]] = True
            else:
                kind[row] = 3
        for row in np.flatnonzero(kind == 2):
            there = np.flatnonzero(exists[row])
            if len(there) > 1:
                exists[row].flat[there[rng.integers(len(there))]] = False
            else:
                kind[row] = 3
        self._shift(weights, exists, functions, np.flatnonzero(kind == 3), rng)
        return self._joined(weights, exists, functions)

    def _live(self, exists: np.ndarray) -> np.ndarray:
        """Connections between nodes in use, of one network, shape (T, J)."""
        used = exists.any(axis=1)[: self.hidden]
        targets = np.append(used, np.ones(self.outputs, bool))
        sources = np.append(np.ones(self.inputs, bool), used)
        return targets[:, None] & sources[None, :]

    def _split(self, weights, exists, functions, rng: np.random.Generator) -> bool:
        """Put a new node into a connection of one network; whether there was room for it."""
        free = np.flatnonzero(~exists.any(axis=1)[: self.hidden])
        targets, sources = np.nonzero(exists)
        # The place must lie after its source and before its target.
        after = sources - self.inputs
        before = np.where(targets < self.hidden, targets, self.hidden)
        fits = (after[:, None] < free) & (free < before[:, None])
        choices = np.argwhere(fits)
        if not len(choices):
            return False
        connection, place = choices[rng.integers(len(choices))]
        target, source, node = targets[connection], sources[connection], free[place]
        exists[target, source] = False
        exists[node] = False
        exists[node, source] = exists[target, self.inputs + node] = True
        weights[node, source] = 0.5 + 0.5 / REACH  # one
        weights[target, self.inputs + node] = weights[target, source]
        functions[node] = rng.random()
        return True

    def tuned(
        self, genomes: np.ndarray, rng: np.random.Generator, first: int, rate: float
    ) -> np.ndarray:
        """Change what the outputs from the `first` on make of all nodes; the others stay.

        Args:
            genomes: Shape (n, D).
            rng: Where chance comes from.
            first: Outputs before this one stay as they are.
            rate: Share of the networks in which a connection appears or vanishes, too.
        """
        weights, exists, functions = self._genes(genomes)
        late = self.hidden + first
        for row in np.flatnonzero(rng.random(len(genomes)) < rate):
            there = np.flatnonzero((self.allowed & self._live(exists[row]))[late:])
            place = there[rng.integers(len(there))]
            exists[row, late:].flat[place] ^= True
        rows = np.arange(len(genomes))
        before = [weights[:, :late].copy(), functions[:, :late].copy()]
        # Only connections into late outputs are there to be shifted.
        some = exists.copy()
        some[:, :late] = False
        self._shift(weights, some, functions, rows, rng)
        weights[:, :late], functions[:, :late] = before
        return self._joined(weights, exists, functions)

    def _shift(self, weights, exists, functions, rows, rng: np.random.Generator) -> None:
        """Shift some weights of some networks, and at times change a function."""
        if not len(rows):
            return
        chosen = (rng.random((len(rows), *self.shape)) < self.rate) & exists[rows]
        # At least one connection, whichever comes out on top of a draw.
        draw = np.where(exists[rows], rng.random((len(rows), *self.shape)), -1.0)
        best = draw.reshape(len(rows), -1).argmax(axis=1)
        chosen.reshape(len(rows), -1)[np.arange(len(rows)), best] = True
        shift = rng.standard_normal((len(rows), *self.shape), dtype=np.float32)
        weights[rows] = folded(weights[rows] + np.float32(self.step) * shift * chosen)
        change = rng.random((len(rows), self.shape[0])) < 0.5 * self.rate
        other = rng.random((len(rows), self.shape[0]), dtype=np.float32)
        functions[rows] = np.where(change, other, functions[rows])

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Every connection with its weight, and every function, from a[i] or from b[i]."""
        ours, theirs = self._genes(a), self._genes(b)
        coins = rng.random((len(a), *self.shape)) < 0.5
        functions = rng.random((len(a), self.shape[0])) < 0.5
        return self._joined(
            np.where(coins, theirs[0], ours[0]),
            np.where(coins, theirs[1], ours[1]),
            np.where(functions, theirs[2], ours[2]),
        )

    def evaluate(self, genomes: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs of n networks, shape (n, outputs, R), for inputs of shape (inputs, R)."""
        weights, exists, functions = self.parts(np.asarray(genomes, np.float32))
        weights = np.where(exists, weights, 0.0).astype(np.float64)
        n, points = len(genomes), inputs.shape[1]
        values = np.zeros((n, self.inputs + self.hidden, points))
        values[:, : self.inputs] = inputs
        outputs = np.empty((n, self.outputs, points))
        for target in range(self.shape[0]):
            rows = np.flatnonzero(exists[:, target].any(axis=1))
            total = np.zeros((len(rows), points))
            for source in np.flatnonzero(exists[rows, target].any(axis=0)):
                total += weights[rows, target, source, None] * values[rows, source]
            for index, function in enumerate(FUNCTIONS.values()):
                here = functions[rows, target] == index
                total[here] = function(total[here])
            if target < self.hidden:
                values[rows, self.inputs + target] = total
            else:
                outputs[:, target - self.hidden] = 0.0
                outputs[rows, target - self.hidden] = total
        return outputs

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Difference of the weights, absent ones being 0, of connections that either has, (n,)."""
        ours, theirs = self.parts(a), self.parts(b)
        gap = np.abs(np.where(ours[1], ours[0], 0.0) - np.where(theirs[1], theirs[0], 0.0))
        either = (ours[1] | theirs[1]).sum(axis=(1, 2))
        apart = gap.sum(axis=(1, 2)) / np.maximum(either, 1)
        used = ours[1].any(axis=2) | theirs[1].any(axis=2)
        other = (ours[2] != theirs[2]) & used
        return 0.5 * (apart + other.sum(axis=1) / np.maximum(used.sum(axis=1), 1))
