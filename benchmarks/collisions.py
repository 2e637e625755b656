"""Collisions: do piles come to rest as they should?

``--piles 10`` drops ten cubes from ten seeds, in every layout and with every integrator.
"""

import argparse
import itertools
import time

import numpy as np

import warp_springs as ws

EDGE = 0.1
WALLS = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))


def dropped(seed: int, count: int = 10) -> list[ws.Robot]:
    """Cubes over each other, at random orientations."""
    rng = np.random.default_rng(seed)
    cubes = []
    for i in range(count):
        cube = ws.shapes.cube(edge=EDGE, mass=0.8, stiffness=1e4)
        turned = cube.moved(-cube.center_of_mass).rotated(rng.normal(size=3), rng.uniform(0, 6))
        cubes.append(turned.moved((*rng.normal(0, 0.02, 2), 0.15 + 0.2 * i)))
    return cubes


def box(damping: float = 0.5, collisions: ws.Collisions | None = None) -> ws.Scene:
    """Four walls around a ground."""
    walls = tuple(ws.Plane(n, -0.16, static_friction=0.3, kinetic_friction=0.3) for n in WALLS)
    return ws.Scene(damping=damping, obstacles=walls, collisions=collisions or ws.Collisions())


def deepest(world: ws.Robot, members, frames: np.ndarray) -> float:
    """How deep any mass of a cube was inside another in any frame [m]: they are convex."""
    worst = 0.0
    for (_, own), (j, _) in itertools.product(members, enumerate(members)):
        if own == members[j][1]:
            continue
        corners = frames[:, world.faces[12 * j : 12 * j + 12]]
        normal = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        arm = frames[:, own][:, :, None] - corners[:, None, :, 0]
        above = np.einsum("ftk,fptk->fpt", normal, arm).max(axis=2)
        worst = max(worst, -float(above.min()))
    return worst


def pile(seed: int, layout: str, integrator: str, precision: str = "float64") -> dict:
    """Drop ten cubes and see how they end."""
    started = time.perf_counter()
    simulation = ws.Simulation(
        dropped(seed),
        box(),
        world="together",
        layout=layout,
        integrator=integrator,
        precision=precision,
    )
    result = simulation.run(5.0, fps=50, energy=True)
    energy, frames = result.energy, result.frames(0)
    start = energy.total[0, 0]
    return {
        "seed": seed,
        "layout": layout,
        "integrator": integrator,
        "status": ws.Status(result.status[0]).name,
        "dt [ms]": 1e3 * float(simulation.robot_dt[0]),
        "depth / edge": deepest(result.robots[0], simulation.members[0], frames) / EDGE,
        "gain": float(np.diff(energy.total[0]).max() / start),
        "residual": float(np.abs(energy.residual[0]).max() / start),
        "left": float(energy.kinetic[0, -1] / start),
        "top [m]": float(frames[-1, :, 2].max()),
        "s": time.perf_counter() - started,
    }


def table(rows: list[dict]) -> None:
    """Print rows as Markdown, as they come."""
    for number, row in enumerate(rows):
        if number == 0:
            print("| " + " | ".join(row) + " |\n|" + "---|" * len(row))
        cells = [f"{v:.2g}" if isinstance(v, float) else str(v) for v in row.values()]
        print("| " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--piles", type=int, default=0, help="seeds of ten cubes each")
    parser.add_argument("--layouts", nargs="+", default=["lanes"])
    parser.add_argument("--integrators", nargs="+", default=["chin4", "leapfrog", "euler"])
    given = parser.parse_args()
    cases = itertools.product(range(given.piles), given.layouts, given.integrators)
    table(pile(*case) for case in cases)


if __name__ == "__main__":
    main()
