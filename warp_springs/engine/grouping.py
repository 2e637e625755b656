"""Which robots share bundles: by what their kernel must be able to do, and by topology.

W robots of one topology share a bundle. A robot that nobody shares its topology with shares one
with robots that are nearly like it, where that pays (see ``merging``), or has one of width one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from warp_springs.body.elements import NONE
from warp_springs.body.variants import Variants
from warp_springs.engine.element_packing import traits_of
from warp_springs.engine.merging import unions
from warp_springs.engine.method import Method
from warp_springs.engine.packing import Strip, breathes
from warp_springs.kernels.dialect import native_width
from warp_springs.kernels.features import Features
from warp_springs.kernels.traits import MERGED, PLAIN, Traits
from warp_springs.robot import Robot
from warp_springs.scene import Scene

__all__ = ["Grouping", "Kind"]

#: What robots that one kernel steps have in common: the width of their bundles, whether they
#: actuate, their layout, their traits.
Kind = tuple[int, bool, str, Traits]


#: Robots that are few of their kind, from which on they share bundles with others.
MANY = 64


class Grouping:
    """The robots of a batch in groups.

    Args:
        robots: The robots.
        scene: Their world.
        method: How they are stepped.
        layout_of: The layout of a robot with so many masses.

    Attributes:
        levels: Halvings of the step of the run for each robot, shape (N,), once they are decided.
        substeps: Contact sub-steps of each robot, shape (N,), likewise.
        refused: Whose step is certainly unstable, shape (N,) bool, likewise.
    """

    def __init__(
        self,
        robots: Sequence[Robot],
        scene: Scene,
        method: Method,
        layout_of: Callable[[int], str],
    ) -> None:
        self._robots, self._scene, self._method = robots, scene, method
        self._layout_of = layout_of
        self.levels = np.zeros(len(robots), np.int64)
        self.substeps = np.ones(len(robots), np.int64)
        self.refused = np.zeros(len(robots), bool)
        self._decided = np.zeros(len(robots), bool)

    def strips(self) -> dict[Kind, list[Strip]]:
        """The robots by kind, and by topology; wide bundles first: alignment."""
        strips = self._by_kind(self._robots)
        return {kind: strips[kind] for kind in sorted(strips, key=_wide_first)}

    def features(self, kind: Kind) -> Features:
        """What the kernel of robots of a kind must be able to do."""
        width, actuated, _, traits = kind
        scene, ground = self._scene, self._scene.ground
        obstacles = len(scene.obstacles) + (ground is not None) if scene.obstacles else 0
        flat = ground is not None and not obstacles  # else it is one of the obstacles
        return Features(
            precision=self._method.precision,
            width=width,
            actuated=actuated,
            ground=flat,
            friction=ground.friction if flat and ground.has_friction else "none",
            wind=scene.wind is not None,
            water=scene.water is not None,
            obstacles=obstacles,
            traits=traits,
            damping=scene.damping > 0.0,
            drag=scene.drag > 0.0,
            integrator=self._method.integrator,
        )

    def _by_kind(self, robots: Sequence[Robot]) -> dict[Kind, list[Strip]]:
        width = native_width(self._method.precision)
        strips: dict[Kind, list[Strip]] = defaultdict(list)
        if self._scene.collisions is not None:
            for index, robot in enumerate(robots):
                strip = Strip.alike([index], [robot])
                traits = replace(traits_of(robot.elements), colliding=True)
                layout = self._layout_of(robot.n_masses)
                strips[1, bool(breathes(strip)[0]), layout, traits].append(strip)
            return strips
        alone: dict[bool, list[int]] = defaultdict(list)
        gathered: list[Strip] = []
        by_hand: list[int] = []
        for cohort in _cohorts(robots, 1 if self._scene.obstacles else 4 * width):
            if isinstance(cohort, int):
                lanes = self._layout_of(robots[cohort].n_masses) == "lanes"
                (alone[robots[cohort].is_actuated] if lanes else by_hand).append(cohort)
                continue
            layout, traits = self._layout_of(int(cohort.masses[0])), traits_of(cohort.elements)
            # A flat body is laid out by its own shape, not by that of the first of many.
            if layout == "flat" and traits == PLAIN:
                by_hand += cohort.ids.tolist()
                continue
            if layout == "flat":
                gathered += [cohort.take(np.array([i])) for i in range(len(cohort.ids))]
                continue
            if layout == "block":
                gathered.append(cohort)
                continue
            for actuated, members in self._alike(cohort):
                # A robot that would be the only one of its bundle needs no other lanes.
                if len(members) % width == 1 and traits != PLAIN:
                    strips[1, actuated, "lanes", traits].append(cohort.take(members[-1:]))
                    members = members[:-1]
                elif len(members) % width == 1:
                    alone[actuated].append(int(cohort.ids[members[-1]]))
                    members = members[:-1]
                if len(members):
                    strips[width, actuated, "lanes", traits].append(cohort.take(members))
        for actuated, ids in alone.items():
            for kind, strip in self._merged(Strip.ragged(ids, [robots[i] for i in ids])):
                strips[kind[0], actuated, "lanes", kind[1]].append(strip)
        if by_hand:
            gathered.append(Strip.ragged(by_hand, [robots[i] for i in by_hand]))
        for cohort in gathered:
            for (actuated, layout), strip in self._gathered(cohort, robots):
                strips[1, actuated, layout, traits_of(cohort.elements)].append(strip)
        return strips

    def _merged(self, strip: Strip) -> Iterator[tuple[tuple[int, Traits], Strip]]:
        """Robots that share their topology with nobody, in common bundles where that pays.

        Where there are obstacles, a mass that is nobody's might touch one.
        """
        width = native_width(self._method.precision)
        if width == 1 or self._scene.obstacles:
            yield (1, PLAIN), strip
            return
        for _, alike in self._alike(strip):
            part = strip.take(alike)
            for members, union in unions(part, width):
                some = part.take(members)
                if union is None:
                    yield from self._few(some, width)
                else:
                    yield (width, MERGED), replace(some, union=union)

    def _few(self, strip: Strip, width: int) -> Iterator[tuple[tuple[int, Traits], Strip]]:
        """Robots that share bundles with none unlike them: those of one topology, and the rest."""
        alike: dict[bytes, list[int]] = defaultdict(list)
        for member, robot in enumerate(strip.ids.tolist()):
            alike[self._robots[robot].topology].append(member)
        for members in alike.values():
            if len(members) > 1:
                ids = strip.ids[members]
                yield (width, PLAIN), Strip.alike(ids, [self._robots[i] for i in ids.tolist()])
        alone = [members[0] for members in alike.values() if len(members) == 1]
        if alone:
            yield (1, PLAIN), strip.take(np.array(sorted(alone)))

    def _gathered(
        self, cohort: Strip, robots: Sequence[Robot]
    ) -> Iterator[tuple[tuple[bool, str], Strip]]:
        """Parts of a cohort that a layout other than the lanes may step together."""
        layouts = np.array([self._layout_of(masses) for masses in cohort.masses.tolist()])
        for actuated, members in self._alike(cohort):
            for layout in np.unique(layouts[members]):
                part = members[layouts[members] == layout]
                ids = cohort.ids[part]
                alike = cohort.take(part) if cohort.shared else None
                yield (
                    (actuated, str(layout)),
                    alike or Strip.ragged(ids, [robots[i] for i in ids.tolist()]),
                )

    def _alike(self, cohort: Strip) -> Iterator[tuple[bool, np.ndarray]]:
        """Members of a cohort that may share bundles: alike in actuation, step and sub-steps.

        And alike in whether they are stepped at all: a bundle of the refused costs no time.
        """
        actuated = breathes(cohort)
        self.decide(cohort)
        decided = (self.levels, self.substeps, self.refused)
        traits = np.stack([actuated, *(values[cohort.ids] for values in decided)])
        if (traits == traits[:, :1]).all():  # as robots of one body mostly are
            yield bool(actuated[0]), np.arange(len(actuated))
            return
        kinds, kind = np.unique(traits, axis=1, return_inverse=True)
        for index in range(kinds.shape[1]):
            yield bool(kinds[0, index]), np.flatnonzero(kind.ravel() == index)

    def decide(self, strip: Strip) -> None:
        """Decide how the robots of a strip are stepped, unless that is known."""
        if self._decided[strip.ids].all():
            return
        levels = self._method.levels(strip, self._scene)
        self.levels[strip.ids] = levels
        substeps = self._method.substeps(strip, self._scene, levels)
        self.substeps[strip.ids] = substeps
        self.refused[strip.ids] = self._method.refused(strip, self._scene, levels, substeps)
        self._decided[strip.ids] = True


def _wide_first(kind: Kind) -> tuple:
    width, actuated, layout, traits = kind
    return -width, layout, actuated, traits.name  # wide bundles first: alignment


def _cohorts(robots: Sequence[Robot], few: int) -> Iterator[Strip | int]:
    """Robots of one topology and structure as one strip; plain ones that are few by their index.

    Where many are alone, or few alike, they fill more lanes beside those that are nearly like them.
    """
    if isinstance(robots, Variants) and len(robots) > 1:
        yield Strip.variants(robots)
        return
    alike: dict[tuple[bytes, bytes], list[int]] = defaultdict(list)
    for index, robot in enumerate(robots):
        alike[robot.topology, robot.elements.structure].append(index)
    rare = [m for m in alike.values() if len(m) <= few and robots[m[0]].elements is NONE]
    most = few if sum(map(len, rare)) > MANY else 1
    for members in alike.values():
        if len(members) <= most and robots[members[0]].elements is NONE:
            yield from members
        else:
            yield Strip.alike(members, [robots[i] for i in members])
