"""Newton's semi-implicit solver: the loop of its examples, and tuned with a captured graph.

Newton's own physics is close to the classroom's, not the same: float32 only; no damping of
velocities; friction is min(kf |v|, mu F_n) against the velocity, where the classroom compares
forces. Rest lengths are constants of its model, which a kernel of the caller's moves. So the
two agree in free flight without damping, and on the ground within the difference of their
frictions.
"""

import newton
import numpy as np
import warp as wp

from peers.problem import Problem

__all__ = ["PROGRAMS", "NewtonLoop", "NewtonTuned", "versions"]

SLOPE = 1.0e3  # of the friction force over the velocity [N s/m]


@wp.kernel
def breathe(
    rest: wp.array[float],
    amplitude: wp.array[float],
    phase: wp.array[float],
    omega: wp.array[float],
    springs: int,
    dt: float,
    count: wp.array[int],
    # outputs
    now: wp.array[float],
):
    s = wp.tid()
    angle = omega[s // springs] * (float(count[0]) * dt)
    now[s] = rest[s] + amplitude[s] * wp.sin(angle + phase[s])


@wp.kernel
def count_up(count: wp.array[int]):
    count[0] = count[0] + 1


class NewtonLoop:
    """Collide, then step, as in Newton's examples."""

    most_threads = 1
    precisions = ("float32",)
    differs = "no damping, smooth friction"

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        wp.config.log_level = wp.LOG_ERROR
        wp.set_device("cpu")
        self.p, self.model = problem, build(problem)
        self.solver = newton.solvers.SolverSemiImplicit(self.model)
        self.states = [self.model.state(), self.model.state()]
        self.control = self.model.control()
        self.pipeline = newton.CollisionPipeline(self.model) if problem.ground_stiffness else None
        self.contacts = self.pipeline.contacts() if self.pipeline else None
        self.breathing = [
            wp.array(getattr(problem, name).ravel().astype(np.float32), dtype=float)
            for name in ("rest_length", "amplitude", "phase", "omega")
        ]
        self.count = wp.zeros(1, dtype=int)

    def collide(self) -> None:
        """Find out which masses are near the ground."""
        if self.pipeline:
            self.pipeline.collide(self.states[0], self.contacts)

    def step(self) -> None:
        """One step of all robots."""
        before, after = self.states
        before.clear_forces()
        inputs = [*self.breathing, self.p.n_springs, self.p.dt, self.count]
        wp.launch(breathe, self.model.spring_count, inputs, [self.model.spring_rest_length])
        wp.launch(count_up, 1, [self.count])
        self.solver.step(before, after, self.control, self.contacts, self.p.dt)
        self.states = [after, before]

    def run(self, steps: int) -> None:
        """Step all robots."""
        for _ in range(steps):
            self.collide()
            self.step()

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        x = self.states[0].particle_q.numpy()
        return x.reshape(self.p.positions.shape).astype(np.float64)


class NewtonTuned(NewtonLoop):
    """The same steps replayed from a captured graph, without the search for particle contacts.

    Which masses are near the flat ground is asked once in 20 steps: whatever is slower than 5 m/s
    stays within the centimetre that the search allows for.
    """

    steps_of_graph = 20  # even, so that the two states end as they began

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        super().__init__(problem, precision, threads)
        self.model.particle_grid = self.graph = None

    def pieces(self, steps: int) -> None:
        """Collide, then step, a few times."""
        self.collide()
        for _ in range(steps):
            self.step()

    def run(self, steps: int) -> None:
        """Step all robots."""
        whole, rest = divmod(steps, self.steps_of_graph)
        for _ in range(whole):
            if self.graph is None:
                with wp.ScopedCapture() as capture:
                    self.pieces(self.steps_of_graph)
                self.graph = capture.graph
            wp.capture_launch(self.graph)
        if rest:
            self.pieces(rest)
            self.graph = self.graph if rest % 2 == 0 else None  # the states are swapped


def build(p: Problem):
    """Newton's model of the population, each robot at its place, all in one world."""
    builder = newton.ModelBuilder()
    active = int(newton.ParticleFlags.ACTIVE)
    for robot in range(p.n_robots):
        first = builder.particle_count
        builder.add_particles(
            pos=p.positions[robot].tolist(),
            vel=p.velocities[robot].tolist(),
            mass=p.masses[robot].tolist(),
            radius=[0.0] * p.n_masses,
            flags=[active] * p.n_masses,
        )
        for (i, j), k in zip(p.springs.tolist(), p.stiffness[robot].tolist(), strict=True):
            builder.add_spring(first + i, first + j, ke=k, kd=0.0, control=0.0)
    if p.ground_stiffness:
        shape = newton.ModelBuilder.ShapeConfig(
            ke=p.ground_stiffness, kd=0.0, kf=SLOPE, mu=p.static_friction
        )
        builder.add_ground_plane(cfg=shape)
    model = builder.finalize()
    model.set_gravity(tuple(p.gravity))
    model.soft_contact_ke, model.soft_contact_kd = p.ground_stiffness, 0.0
    model.soft_contact_kf, model.soft_contact_mu = SLOPE, p.static_friction
    return model


PROGRAMS = {"Newton": NewtonLoop, "Newton graph": NewtonTuned}


def versions() -> dict[str, str]:
    """Versions of Newton and of its Warp."""
    return {"newton": newton.__version__, "warp-lang": wp.config.version}
