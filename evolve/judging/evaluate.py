"""Evaluation: a whole generation in one simulation, and the second look at champions."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from evolve.config import RunConfig, SceneConfig
from evolve.fitness import FITNESS, SAMPLES_PER_CYCLE, Trial, body_diameters
from evolve.judging.scores import Scores
from evolve.judging.second_look import SecondLook, quantile, share
from evolve.judging.trials import aggregate, perturbed, scattered
from evolve.streams import Role, Streams

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["Evaluator"]

MOST_HALVINGS = 4
"""Of the step of a second look, beyond the first."""

Place = tuple[float, float, float]

MARK = 0.06
"""Radius of the ball that marks a goal in films [m]."""


class Evaluator:
    """Runs the trial of a configuration: robots settle, then they are measured.

    A robot's scores do not depend on which robots it is evaluated with, nor on the number of
    threads.
    """

    def __init__(self, config: RunConfig) -> None:
        self.task = config.task
        self.descriptors = config.descriptors
        """Names of what is measured beside the fitness."""
        self.measures = (config.task.fitness, *self.descriptors, *config.task.limits.given)
        """Names of all that must be known of a trial."""
        self.simulation = config.simulation
        self.scene = config.scene.build()
        self._scenery: SceneConfig | None = config.scene
        self._goals = config.task.goals or (None,)
        self.streams = Streams(config.seed)
        self.period = config.encoding.period
        """Time of a cycle of the muscles [s]."""
        self.settle = config.task.settle * self.period
        """Settling time [s]."""
        self.measure = config.task.measure * self.period
        """Time of the measurement [s]."""

    def __call__(self, robots: Sequence[ws.Robot]) -> Scores:
        """Simulate the robots, all at once, and score them."""
        started = time.perf_counter()
        scores = [
            self._score(starts, robots, scene, goal)
            for starts, scene in self._starts(robots)
            for goal in self._goals
        ]
        scores = scores[0] if len(scores) == 1 else self._mean(scores)
        return replace(scores, wall_time=time.perf_counter() - started)

    def _starts(self, robots: Sequence[ws.Robot]) -> Iterator[tuple[Sequence[ws.Robot], ws.Scene]]:
        """The robots and their world in each of the trials: a floor and starts of its own."""
        settings, worlds = self.task.trials, self._worlds()
        if len(worlds) == 1:
            yield robots, worlds[0]
            return
        yield from zip(
            scattered(robots, settings, self.streams, settings.count), worlds, strict=True
        )

    def _worlds(self) -> list[ws.Scene]:
        """The world of each of the trials."""
        settings = self.task.trials
        if settings.count == 1:
            return [self.scene]
        scenes = [self.scene] * settings.count
        if settings.terrain and self._scenery is not None:
            scenes = [_of_next_seeds(self._scenery, trial).build() for trial in range(len(scenes))]
        spread = np.linspace(-settings.friction, settings.friction, len(scenes))
        return [_rougher(s, 1.0 + float(change)) for s, change in zip(scenes, spread, strict=True)]

    def _mean(self, trials: Sequence[Scores]) -> Scores:
        """One score for each robot from those of its trials."""
        status = np.stack([trial.status for trial in trials])
        first = np.argmax(status != 0, axis=0)
        return Scores(
            fitness=self._together([trial.fitness for trial in trials]),
            status=np.take_along_axis(status, first[None], axis=0)[0],
            descriptors={
                name: np.mean([trial.descriptors[name] for trial in trials], axis=0)
                for name in self.descriptors
            },
            spring_evaluations=np.sum([trial.spring_evaluations for trial in trials], axis=0),
        )

    def _score(
        self,
        starts: Sequence[ws.Robot],
        robots: Sequence[ws.Robot],
        scene: ws.Scene,
        goal: Place | None,
    ) -> Scores:
        """Scores of one trial of robots that begin it as `starts`."""
        simulation = self._simulate(self._aimed(starts, goal), scene=scene)
        # Measures look at a robot as it was built, not as it was bent for the start.
        trial = self._trial(simulation, robots, goal)
        status = np.asarray(trial.measured.status, dtype=np.int64)
        found = {name: FITNESS[name](trial) for name in self.descriptors}
        return Scores(
            fitness=self._fair(trial),
            status=status,
            descriptors={k: np.where(status == 0, v, np.nan) for k, v in found.items()},
            spring_evaluations=_costs(trial, simulation.robot_dt),
        )

    def within(self, scene: ws.Scene) -> Evaluator:
        """The same trials in another world, the same ground in all of them."""
        other = copy.copy(self)
        other.scene, other._scenery = scene, None
        return other

    def prepare(self, robots: Sequence[ws.Robot]) -> None:
        """Load the kernels for such robots: a new machine compiles them first."""
        self._simulate(robots)

    def second_look(self, robots: Sequence[ws.Robot], fitness: np.ndarray) -> SecondLook:
        """Repeat the trials at half the time step in float64, and from perturbed starts.

        Each robot takes half its own step, or half its longest stable one if that is less; robots
        of the same step run in one simulation. The perturbed trials of all robots run in another,
        as the first trial ran but for the starts; where there are several trials, in the world of
        each of them in turn.

        Args:
            robots: n robots.
            fitness: Their fitness at the first look, shape (n,).
        """
        settings = self.task.second_look
        dt = self._doubtless_steps(robots)
        halved = np.full(len(robots), np.nan)
        for step in np.unique(dt):
            alike = np.flatnonzero(dt == step)
            some = [robots[i] for i in alike]
            found = [
                self._looked(starts, some, scene, float(step), "float64")
                for starts, scene in self._starts(some)
            ]
            halved[alike] = self._together(found)
        trials = self._perturbed(robots)
        usual = quantile(trials, settings.quantile)
        kept = share(halved, fitness), share(usual, fitness)
        survives = (kept[0] >= settings.threshold) & (kept[1] >= settings.threshold)
        return SecondLook(dt, halved, kept[0], usual, kept[1], survives)

    def _perturbed(self, robots: Sequence[ws.Robot]) -> np.ndarray:
        """Fitness of robots from perturbed starts, shape (N, trials)."""
        settings, worlds = self.task.second_look, self._worlds()
        count = settings.trials
        starts = [
            list(perturbed(robot, settings, self.streams, Role.SECOND_LOOK, count))
            for robot in robots
        ]
        fitness = np.empty((len(robots), count))
        for first, scene in enumerate(worlds[:count]):
            mine = range(first, count, len(worlds))
            some = [own[trial] for own in starts for trial in mine]
            # The fitness measures a robot as it was built, not as it was bent for the start.
            built = [robot for robot in robots for _ in mine]
            fitness[:, mine] = self._looked(some, built, scene).reshape(len(robots), -1)
        return fitness

    def _doubtless_steps(self, robots: Sequence[ws.Robot]) -> np.ndarray:
        """Half the step of each robot, or of its longest stable one if that is less, (N,) [s].

        Half of a step that is too long may be too long as well, and agree with it. Halved as often
        as needed, so that few different steps occur.
        """
        import warp_springs as ws

        first = self._simulate(robots).robot_dt
        integrator = self.simulation.integrator
        stable = np.array([ws.stable_dt(robot, self.scene, integrator) for robot in robots])
        excess = np.ceil(np.log2(np.maximum(first / np.maximum(stable, 1e-300), 1.0)))
        return 0.5 * first * 0.5 ** np.minimum(excess, MOST_HALVINGS)

    def film(
        self,
        robots: Sequence[ws.Robot],
        fps: float = 30.0,
        least_cycles: float = 0.0,
        energy: bool = False,
        progress: Callable[[float], None] | None = None,
    ) -> ws.Result:
        """Simulate a whole trial, or more cycles if asked, and record all frames of all robots.

        They make for the first goal, if there are any; a ball marks where it is at the end.
        """
        duration = max(self.settle + self.measure, least_cycles * self.period)
        simulation = self._simulate(self._aimed(robots, self._goals[0]))
        seen = simulation.run(duration, fps=fps, energy=energy, progress=progress)
        return self._marked(seen, self._goals[0])

    def _marked(self, result: ws.Result, goal: Place | None) -> ws.Result:
        """The result with a ball where its goal is at the end."""
        import warp_springs as ws

        ground = result.scene.ground
        if goal is None or (ground is not None and ground.friction == "course"):
            return result
        place = np.asarray(goal) + result.end_time * np.asarray(self.task.goal_motion)
        ball = ws.Sphere(center=tuple(place.tolist()), radius=MARK)
        scene = replace(result.scene, obstacles=(*result.scene.obstacles, ball))
        return replace(result, scene=scene)

    def _looked(
        self,
        starts: Sequence[ws.Robot],
        built: Sequence[ws.Robot],
        scene: ws.Scene,
        dt: float | None = None,
        precision: str | None = None,
    ) -> np.ndarray:
        """Fitness of robots at a second look in a world, shape (N,), over all goals."""
        found = []
        for goal in self._goals:
            simulation = self._simulate(self._aimed(starts, goal), dt, precision, scene)
            found.append(self._fitness(self._trial(simulation, built, goal)))
        return self._together(found)

    def _together(self, fitness: Sequence[np.ndarray]) -> np.ndarray:
        """One fitness for each robot from those of several trials."""
        return fitness[0] if len(fitness) == 1 else aggregate(fitness, self.task.trials.aggregate)

    def _aimed(self, robots: Sequence[ws.Robot], goal: Place | None) -> Sequence[ws.Robot]:
        """The robots with a goal that their sensors look for."""
        import warp_springs as ws

        if goal is None:
            return robots
        motion = self.task.goal_motion
        if isinstance(robots, ws.Variants):
            return robots.body.aimed(goal, motion).variants(**robots.stacked)
        return [robot.aimed(goal, motion) for robot in robots]

    def _fitness(self, trial: Trial) -> np.ndarray:
        """Fitness of every robot, shape (N,); NaN for those who were stopped."""
        stopped = np.asarray(trial.measured.status) != 0
        return np.where(stopped, np.nan, self._fair(trial))

    def _fair(self, trial: Trial) -> np.ndarray:
        """What the task selects for, shape (N,); NaN for those beyond a limit.

        So it is for bodies built into the ground, which would be shot out of it.
        """
        fitness = FITNESS[self.task.fitness](trial)
        if self.scene.ground is not None:
            fitness = np.where(_buried(trial.robots), np.nan, fitness)
        for name, most in self.task.limits.given.items():
            # Rounding must not decide about a body of exactly what is allowed.
            fitness = np.where(FITNESS[name](trial) <= most * (1.0 + 1e-9), fitness, np.nan)
        return fitness

    def _trial(
        self, simulation: ws.Simulation, robots: Sequence[ws.Robot], goal: Place | None
    ) -> Trial:
        """Run a trial; `robots` is whom to measure."""
        used = [FITNESS[name] for name in self.measures]
        energy = any(measure.needs_energy for measure in used)
        count = 1
        if any(measure.needs_path for measure in used):
            count = max(2, round(SAMPLES_PER_CYCLE * self.task.measure))
        settled = simulation.run(self.settle)
        # Each piece ends at the step next to where it should, so that no error adds up.
        ends = self.settle + self.measure * np.arange(1, count + 1) / count
        pieces = [simulation.run(end - simulation.time, energy=energy) for end in ends]
        direction = np.array(self.task.direction) / np.hypot(*self.task.direction)
        return Trial(robots, settled, pieces, tuple(direction), goal, self.task.goal_motion)

    def _simulate(
        self,
        robots: Sequence[ws.Robot],
        dt: float | None = None,
        precision: str | None = None,
        scene: ws.Scene | None = None,
    ) -> ws.Simulation:
        """Pack robots, with the step, precision and scene of the configuration unless told."""
        import warp_springs as ws

        settings = self.simulation
        return ws.Simulation(
            robots,
            self.scene if scene is None else scene,
            dt=settings.dt if dt is None else dt,
            precision=settings.precision if precision is None else precision,
            integrator=settings.integrator,
            device=settings.device,
            layout=settings.layout,
            threads=settings.threads,
        )


def _of_next_seeds(scene: SceneConfig, shift: int) -> SceneConfig:
    """The scene with other rough ground, so many seeds on."""
    rough = [
        o.model_copy(update={"seed": o.seed + shift}) if o.type == "rough" else o
        for o in scene.obstacles
    ]
    return scene.model_copy(update={"obstacles": tuple(rough)})


def _rougher(scene: ws.Scene, factor: float) -> ws.Scene:
    """The scene with so many times the friction."""
    ground = scene.ground
    if ground is None or factor == 1.0:
        return scene
    coefficients = {
        name: factor * getattr(ground, name) for name in ("static_friction", "kinetic_friction")
    }
    return replace(scene, ground=replace(ground, **coefficients))


def _buried(robots: Sequence[ws.Robot]) -> np.ndarray:
    """Whether bodies as they were built reach below the ground, shape (N,) or for all, ()."""
    import warp_springs as ws

    if isinstance(robots, ws.Variants) and "positions" not in robots.stacked:
        robots = [robots.body]
    lowest = np.array([robot.positions[:, 2].min() for robot in robots])
    buried = lowest < -1e-3 * body_diameters(robots)
    return buried if len(buried) > 1 else buried[0]


def _costs(trial: Trial, dt: np.ndarray) -> np.ndarray:
    """Spring evaluations of every robot, shape (N,): the total, shared out by springs x steps."""
    import warp_springs as ws

    robots, end = trial.robots, trial.measured.end_time
    fixed = isinstance(robots, ws.Variants)
    springs = robots.body.n_springs if fixed else [robot.n_springs for robot in robots]
    times = np.where(np.asarray(trial.measured.status) == 0, end, trial.measured.status_time)
    weights = np.asarray(springs) * times / dt
    total = sum(result.spring_evaluations for result in (trial.settled, *trial.pieces))
    return np.rint(total * (weights / max(weights.sum(), 1e-300))).astype(np.int64)
