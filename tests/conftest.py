"""What all tests share: quiet kernels, repeatable examples, and a few robots."""

import hypothesis
import numpy as np
import pytest
import warp as wp

wp.config.log_level = wp.LOG_WARNING  # before Warp starts, so that it prints no banner

# The same examples on every machine, and no deadline: the first one compiles a kernel. Compiled
# kernels stay in Warp's own cache on disk, so later tests and later runs load them.
hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def cube():
    """The course's cube at the origin: 0.1 m, 0.8 kg, 28 springs of 1,000 N/m, at rest."""
    import warp_springs as ws

    return ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1000.0)


@pytest.fixture(scope="session")
def tumbling_cube(cube):
    """The cube turned on a corner and set spinning, its centre 0.3 m above the ground."""
    turned = cube.moved(-cube.center_of_mass).rotated(axis=(1, 2, 3), angle=0.7)
    return turned.moved((0.0, 0.0, 0.3)).spinning((3.0, -2.0, 4.0))


@pytest.fixture(scope="session")
def walker():
    """Two cubes side by side, breathing out of phase, low enough to land within 0.1 s."""
    import warp_springs as ws

    body = ws.shapes.lattice(2, 1, 1, edge=0.1, mass_per_vertex=0.1, stiffness=1500.0)
    springs = body.n_springs
    return body.replace(
        amplitude=0.08 * body.rest_length, phase=np.linspace(0.0, 6.0, springs), omega=12.0
    ).moved((0.0, 0.0, 0.02))


@pytest.fixture(scope="session")
def breaking_rod():
    """Two masses that fly apart in the void; the spring between them breaks when it is stretched
    by 0.1 m, a little after 0.05 s."""
    import warp_springs as ws

    ends, apart = [(-0.1, 0.0, 0.1), (0.1, 0.0, 0.1)], [(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    rod = ws.Robot(masses=1.0, positions=ends, springs=[(0, 1)], stiffness=100.0, velocities=apart)
    return rod.with_limits(breaks=10.0)
