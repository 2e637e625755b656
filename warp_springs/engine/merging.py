"""Robots of different topologies cut from one lattice, side by side in the lanes.

Their masses lie on the sites of a common lattice. W robots that fill nearly the same sites form one
bundle whose topology is the union of theirs: where a robot has no mass, its lane holds one that
nothing moves, where it has no spring, one that does not pull. The sites are numbered in the order
of every robot's masses, so each force is the same sum, to the bit, as where the robot is alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from warp_springs.engine.curve import ranges
from warp_springs.engine.packing import Strip, largest, sort_rows

__all__ = ["Union", "unions"]

#: How far from its site a mass may be, in spacings of the lattice.
OFF_SITE = 1e-3
#: Sites of a lattice that is worth looking at, and spacings between the ends of its springs.
MOST_SITES, MOST_WAYS = 4096, 256
#: The part of a bundle's springs that must be somebody's: less, and each robot alone is as fast.
LEAST_FILLED = 0.45


@dataclass(frozen=True)
class Union:
    """How n robots share bundles of W lanes, the first W the first one, and so on.

    Attributes:
        width: W.
        masses: Masses of each of B bundles, shape (B,).
        springs: Springs of each bundle, shape (B,).
        mass_row: Place in its bundle of each mass of each robot, end to end.
        spring_row: Likewise of each spring, sorted into rows.
        rows: Row starts of all bundles, (sum of masses + B,).
        partners: The higher mass of each spring of all bundles.
    """

    width: int
    masses: np.ndarray
    springs: np.ndarray
    mass_row: np.ndarray
    spring_row: np.ndarray
    rows: np.ndarray
    partners: np.ndarray

    def lanes_of(
        self, values: np.ndarray, counts: np.ndarray, springs: bool, nothing: np.ndarray
    ) -> np.ndarray:
        """Values of masses or springs with the lane as the innermost index, flat.

        Args:
            values: Shape (total, columns); so many for each robot as `counts` says.
            counts: Shape (n,).
            springs: Whether they are of springs.
            nothing: What lanes hold that have none, shape (columns,).
        """
        values = values if values.ndim == 2 else values.reshape(len(values), -1)
        sizes, row = (self.springs, self.spring_row) if springs else (self.masses, self.mass_row)
        columns, width = values.shape[1], self.width
        table = np.zeros((sizes.sum(), columns, width), values.dtype)
        if nothing.any():
            table[:] = nothing[:, None]
        robot, first = np.arange(len(counts)), np.cumsum(sizes) - sizes
        start = first[robot // width] * (columns * width) + robot % width
        place, flat = np.repeat(start, counts) + row * (columns * width), table.ravel()
        for column in range(columns):  # each is in one piece
            flat[place] = values[:, column]
            place += width
        return flat


def unions(strip: Strip, width: int) -> Iterator[tuple[np.ndarray, Union | None]]:
    """Members of a strip of different robots, that may share bundles, and how they do.

    The last members, for whom that does not pay, come with ``None``.
    """
    lattice = _Lattice.of(strip) if len(strip.ids) > width * LEAST_FILLED else None
    alone = np.ones(len(strip.ids), bool)
    if lattice is not None and lattice.fits.any():
        members, union = lattice.bundled(strip, width)
        if len(members):
            alone[members] = False
            yield members, union
    if alone.any():
        yield np.flatnonzero(alone), None


@dataclass(frozen=True)
class _Lattice:
    """A lattice on whose sites the masses of some robots lie.

    Attributes:
        fits: Whose do, in their order and without two springs between the same masses, (n,) bool.
        sites: Number of sites.
        site: Of each mass of all robots; meaningless for those that do not fit.
        lower: Site of the lower mass of each spring, sorted into rows.
        way: What leads from there to the other, by its place in `ways`.
        ways: Differences of the numbers of two sites that springs join.
    """

    fits: np.ndarray
    sites: int
    site: np.ndarray
    lower: np.ndarray
    way: np.ndarray
    ways: np.ndarray

    @classmethod
    def of(cls, strip: Strip) -> _Lattice | None:
        """The lattice of as many robots as possible; None where there is none."""
        masses, counts = strip.masses, strip.counts
        first = np.cumsum(masses) - masses
        _, row, partner = sort_rows(strip)
        lengths = np.diff(row)
        inner = np.ones(len(lengths), bool)
        inner[np.cumsum(masses + 1)[:-1] - 1] = False  # between two robots
        lower = np.repeat(np.arange(masses.sum()), lengths[inner])
        higher = partner + np.repeat(first, counts)

        positions = strip.fields["positions"]
        ends = positions[higher] - positions[lower]
        # In spacings of the lattice, one over the shortest spring.
        spacings = largest(1.0 / np.sqrt(np.einsum("ij,ij->i", ends, ends)), counts)
        steps = positions - np.repeat(np.minimum.reduceat(positions, first), masses, axis=0)
        steps *= np.repeat(spacings, masses)[:, None]
        grid = np.clip(np.nan_to_num(np.rint(steps)), 0.0, MOST_SITES)
        off = ~(np.abs(steps - grid).max(axis=1) < OFF_SITE)
        fits = (largest(off.astype(float), masses) == 0.0) & (counts > 0)
        if not fits.any():
            return None
        size = grid[np.repeat(fits, masses)].max(axis=0).astype(np.int64) + 1
        sites = int(size.prod())
        if sites > MOST_SITES:
            return None
        grid[~np.repeat(fits, masses)] = 0.0
        site = (grid @ [size[1] * size[2], size[2], 1]).astype(np.int64)
        rising = np.append(np.diff(site) > 0, True)
        rising[np.cumsum(masses) - 1] = True
        fits &= largest((~rising).astype(float), masses) == 0.0
        low, way = site[lower], site[higher] - site[lower]
        twice = np.append(False, (low[1:] == low[:-1]) & (way[1:] == way[:-1]))
        twice[np.cumsum(counts)[:-1][counts[1:] > 0]] = False
        fits &= largest(twice.astype(float), counts) == 0.0
        there = np.repeat(fits, counts)
        ways = np.flatnonzero(np.bincount(way[there], minlength=1))
        if not len(ways) or len(ways) > MOST_WAYS:
            return None
        place = np.zeros(max(int(way.max(initial=0)), int(ways[-1])) + 1, np.int64)
        place[ways] = np.arange(len(ways))
        return cls(fits, sites, site, low, place[np.where(there, way, ways[0])], ways)

    def bundled(self, strip: Strip, width: int) -> tuple[np.ndarray, Union]:
        """Those who fit, like beside like, and their bundles, but those that are too empty."""
        members = np.flatnonzero(self.fits)
        taken = strip.take(members)
        of_mass, of_spring = np.repeat(self.fits, strip.masses), np.repeat(self.fits, strip.counts)
        site, key = self.site[of_mass], (self.lower * len(self.ways) + self.way)[of_spring]
        filled = np.zeros((len(members), self.sites), bool)
        filled[np.repeat(np.arange(len(members)), taken.masses), site] = True
        order = np.concatenate(list(_like_beside_like(filled, np.arange(len(members)), width)))
        bundle = np.empty_like(order)
        bundle[order] = np.arange(len(order)) // width
        there = self._springs_there(np.repeat(bundle, taken.counts), key)
        own = np.bincount(bundle, taken.counts)
        full = own >= LEAST_FILLED * width * there.sum(axis=1)
        kept = order[full[bundle[order]]]
        return members[kept], self._union(taken, kept, site, key, width)

    def _springs_there(self, bundle: np.ndarray, key: np.ndarray) -> np.ndarray:
        """Which springs of the lattice each bundle has, of springs in their bundles."""
        there = np.zeros((bundle.max(initial=-1) + 1, self.sites * len(self.ways)), bool)
        there[bundle, key] = True
        return there

    def _union(
        self, strip: Strip, kept: np.ndarray, site: np.ndarray, key: np.ndarray, width: int
    ) -> Union:
        """The bundles of the robots `kept` of a strip, W after W."""
        first = np.cumsum(strip.masses) - strip.masses
        site = site[ranges(first[kept], strip.masses[kept])]
        first = np.cumsum(strip.counts) - strip.counts
        key = key[ranges(first[kept], strip.counts[kept])]
        bundle = np.arange(len(kept)) // width
        of_mass = np.repeat(bundle, strip.masses[kept])
        of_spring = np.repeat(bundle, strip.counts[kept])

        masses = np.zeros((bundle.max(initial=-1) + 1, self.sites), bool)
        masses[of_mass, site] = True
        mass_rank = np.cumsum(masses, axis=1) - 1
        springs = self._springs_there(of_spring, key)
        spring_rank = np.cumsum(springs, axis=1) - 1
        which, keys = np.nonzero(springs)
        low, way = np.divmod(keys, len(self.ways))
        # Where the springs of every mass start, and at last where they end.
        starts = np.zeros((len(masses), self.sites + 1), np.int64)
        springs.reshape(*masses.shape, len(self.ways)).sum(axis=2).cumsum(axis=1, out=starts[:, 1:])
        listed = np.pad(masses, ((0, 0), (0, 1)), constant_values=True)
        return Union(
            width=width,
            masses=masses.sum(axis=1),
            springs=springs.sum(axis=1),
            mass_row=mass_rank[of_mass, site],
            spring_row=spring_rank[of_spring, key],
            rows=starts[listed].astype(np.int32),
            partners=mass_rank[which, low + self.ways[way]].astype(np.int32),
        )


def _like_beside_like(filled: np.ndarray, robots: np.ndarray, width: int) -> Iterator[np.ndarray]:
    """The robots in an order in which those that fill the same sites are neighbours.

    They are split by the site that most nearly half of them fill, and each half likewise.
    """
    if len(robots) > width:
        share = np.abs(filled[robots].mean(axis=0) - 0.5)
        chosen = int(np.argmin(share))
        if share[chosen] < 0.5:
            half = filled[robots, chosen]
            yield from _like_beside_like(filled, robots[half], width)
            yield from _like_beside_like(filled, robots[~half], width)
            return
    yield robots
