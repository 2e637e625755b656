"""Collisions and worlds: bounces and friction in closed form, a pile, who meets whom."""

import numpy as np
import pytest

import warp_springs as ws

WEIGHTLESS = {"gravity": (0, 0, 0), "ground": None}
SMOOTH = {"static_friction": 0.0, "kinetic_friction": 0.0, "damping": 0.0}


def point(position, velocity, mass=0.1):
    return ws.Robot(
        masses=[mass],
        positions=[position],
        velocities=[velocity],
        springs=np.empty((0, 2), int),
        stiffness=[],
    )


def plate(size=1.0, mass=1.0):
    """A fixed triangle in the plane z = 0 around the origin."""
    angles = np.array([0, 2, 4]) * np.pi / 3
    corners = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) * size
    return ws.Robot(
        masses=mass,
        positions=corners,
        springs=[(0, 1), (1, 2), (0, 2)],
        stiffness=1e3,
        faces=[(0, 1, 2)],
    ).fixed()


def together(robots, duration, dt=1e-4, fps=50, collisions=None, **scene):
    scene = ws.Scene(collisions=collisions or ws.Collisions(thickness=0.01), **scene)
    simulation = ws.Simulation(robots, scene, dt=dt, world="together")
    return simulation, simulation.run(duration, fps=fps, energy=True)


def test_a_mass_bounces_off_a_triangle_as_off_a_spring():
    k = 1e4
    collisions = ws.Collisions(thickness=0.01, stiffness=k, **SMOOTH)
    mass = point((0.1, 0.05, 0.11), (0.3, 0.0, -1.0))
    _, result = together([mass, plate()], 0.3, collisions=collisions, **WEIGHTLESS)
    contact = np.pi * np.sqrt(0.1 / k)  # half a period, the plate is fixed
    there = 0.01 + 1.0 * (0.3 - 0.1 - contact)
    assert result.positions(0)[0] == pytest.approx((0.1 + 0.3 * 0.3, 0.05, there), abs=1e-4)
    assert result.velocities(0)[0] == pytest.approx((0.3, 0.0, 1.0), abs=1e-5)
    assert np.abs(result.energy.residual).max() < 1e-5
    assert result.energy.ground.max() >= 0.0


@pytest.mark.parametrize("integrator", ["chin4", "leapfrog", "euler"])
def test_crossed_rods_of_equal_mass_exchange_their_velocities(integrator):
    rods = {"masses": [0.1, 0.1], "springs": [(0, 1)], "stiffness": [1e4]}
    one = ws.Robot(positions=[(-0.1, 0, 0), (0.1, 0, 0)], **rods).moving((0, 0, -1.0))
    two = ws.Robot(positions=[(0, -0.1, -0.1), (0, 0.1, -0.1)], **rods)
    scene = ws.Scene(collisions=ws.Collisions(thickness=0.01, **SMOOTH), **WEIGHTLESS)
    simulation = ws.Simulation([one, two], scene, dt=5e-5, integrator=integrator, world="together")
    result = simulation.run(0.2, fps=50, energy=True)
    up, down = result.velocities(0)[:2].mean(axis=0), result.velocities(0)[2:].mean(axis=0)
    assert up == pytest.approx((0, 0, 0), abs=2e-3)
    assert down == pytest.approx((0, 0, -1), abs=2e-3)


def test_a_mass_slides_on_a_face_as_far_as_its_friction_lets_it():
    mu, v = 0.5, 1.0
    collisions = ws.Collisions(thickness=0.01, static_friction=mu, kinetic_friction=mu, damping=0.3)
    sunk = 0.1 * 9.81 / collisions.stiffness
    mass = point((-0.2, 0.0, 0.01 - sunk), (v, 0.0, 0.0))
    _, result = together([mass, plate()], 0.5, collisions=collisions, ground=None)
    assert result.positions(0)[0, 0] + 0.2 == pytest.approx(v**2 / (2 * mu * 9.81), rel=0.01)
    assert np.abs(result.velocities(0)[0]).max() < 1e-3
    assert result.energy.friction_loss[0, -1] == pytest.approx(0.05 * v**2, rel=0.01)


def test_momentum_and_energy_survive_a_crash_of_two_spinning_cubes(cube):
    stiff = cube.replace(stiffness=1e4).moved(-cube.center_of_mass)
    one = stiff.rotated((1, 2, 3), 0.7).spinning((3, -2, 4)).moving((1.0, 0, 0))
    two = stiff.rotated((3, 1, 2), 0.4).spinning((-1, 5, 2)).moved((0.3, 0.03, 0.02))
    smooth = ws.Collisions(**SMOOTH)
    simulation, result = together([one, two], 0.5, collisions=smooth, **WEIGHTLESS)
    world = result.robots[0]
    v, x = result.velocities(0), result.positions(0)
    assert world.masses @ v == pytest.approx((0.8, 0, 0), abs=1e-10)
    spin = [
        (world.masses[:, None] * np.cross(*state)).sum(axis=0)
        for state in ((x, v), (world.positions, world.velocities))
    ]
    assert spin[0] == pytest.approx(spin[1], abs=1e-9)
    second = simulation.members[0][1][1]
    assert world.masses[second] @ v[second, 0] > 0.3  # it was pushed
    assert np.abs(result.energy.residual).max() < 5e-3 * result.energy.total[0, 0]


def depth(world, members, x):
    """How deep any mass of one cube is inside another: they are convex."""
    worst = 0.0
    for i, (_, own) in enumerate(members):
        for j in range(len(members)):
            corners = x[world.faces[12 * j : 12 * j + 12]]
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            above = np.einsum("tk,ptk->pt", normal, x[own][:, None] - corners[:, 0]).max(axis=1)
            worst = max(worst, -above.min()) if i != j else worst
    return worst


def test_ten_cubes_come_to_rest_in_a_pile():
    rng = np.random.default_rng(1)
    cubes = []
    for i in range(10):
        cube = ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1e4)
        turned = cube.moved(-cube.center_of_mass).rotated(rng.normal(size=3), rng.uniform(0, 6))
        cubes.append(turned.moved((*rng.normal(0, 0.02, 2), 0.15 + 0.2 * i)))
    normals = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
    walls = tuple(ws.Plane(n, -0.16, static_friction=0.3, kinetic_friction=0.3) for n in normals)
    scene = ws.Scene(damping=0.5, obstacles=walls, collisions=ws.Collisions())
    simulation = ws.Simulation(cubes, scene, world="together")
    result = simulation.run(4.0, fps=25, energy=True)
    energy, frames = result.energy, result.frames(0)
    assert result.status[0] == ws.Status.OK
    assert max(depth(result.robots[0], simulation.members[0], x) for x in frames) < 0.005
    assert np.diff(energy.total[0]).max() < 1e-3 * energy.total[0, 0]  # nothing from nowhere
    assert energy.kinetic[0, -1] < 1e-4 * energy.total[0, 0]
    assert frames[-1, :, 2].max() > 0.2  # some lie on others
    assert np.abs(frames[-1] - frames[-6]).max() < 0.01


def test_a_body_meets_itself_only_if_asked(cube):
    upper = cube.moved((0.02, 0.03, 0.3)).moving((0, 0, -1.0))
    body = cube.joined(upper)  # no spring between the two parts
    for within, stops in ((True, True), (False, False)):
        scene = ws.Scene(collisions=ws.Collisions(within=within), **WEIGHTLESS)
        result = ws.Simulation(body, scene, dt=2e-4).run(0.3)
        below = result.positions(0)[8:, 2].min() < 0.05
        assert below != stops


def test_robots_of_separate_worlds_never_meet(cube):
    low, high = cube, cube.moved((0, 0, 0.15)).moving((0, 0, -1.0))
    scene = ws.Scene(collisions=ws.Collisions(), **WEIGHTLESS)
    apart = ws.Simulation([low, high], scene, dt=5e-4).run(0.2)
    assert apart.positions(0) == pytest.approx(low.positions, abs=1e-12)
    pairs = ws.Simulation([low, low, high, high], scene, dt=5e-4, world=[0, 1, 0, 0])
    assert [[robot for robot, _ in inside] for inside in pairs.members] == [[0, 2, 3], [1]]
    result = pairs.run(0.2)
    assert len(result) == 2
    assert result.positions(1) == pytest.approx(low.positions, abs=1e-12)
    assert np.abs(result.positions(0)[pairs.members[0][0][1]] - low.positions).max() > 0.01


def test_a_grid_puts_robots_side_by_side_and_changes_nothing_else(cube, walker):
    alone = ws.Simulation([cube, walker, cube], ws.Scene(), dt=5e-4).run(0.1)
    grid = ws.Simulation([cube, walker, cube], ws.Scene(), dt=5e-4, world="grid").run(0.1)
    for i in range(3):
        shift = grid.robots[i].positions[0] - alone.robots[i].positions[0]
        assert grid.positions(i) - shift == pytest.approx(alone.positions(i), abs=1e-9)
    distances = np.linalg.norm(np.diff(grid.center_of_mass[:, :2], axis=0), axis=1)
    assert distances.min() > walker.diameter


def test_robots_with_omegas_of_their_own_share_a_world(cube):
    robots = [cube.breathing(0.1, 5.0), cube.moved((0.5, 0, 0)).breathing(0.1, 9.0)]
    scene = ws.Scene(**WEIGHTLESS)
    world = ws.Simulation(robots, scene, dt=5e-4, world="together").run(0.2)
    apart = ws.Simulation(robots, scene, dt=5e-4).run(0.2)
    assert world.positions(0)[8:] == pytest.approx(apart.positions(1), abs=1e-11)


def test_looking_changes_nothing(cube):
    robots = [cube, cube.rotated((1, 2, 3), 0.5).moved((0.02, 0, 0.2))]
    scene = ws.Scene(collisions=ws.Collisions())
    seen = ws.Simulation(robots, scene, dt=5e-4, world="together").run(0.3, fps=100)
    unseen = ws.Simulation(robots, scene, dt=5e-4, world="together").run(0.3)
    assert np.array_equal(seen.positions(0), unseen.positions(0))


def garbage(rng):
    """A body that nobody would build: masses anywhere, faces and springs at random."""
    n = int(rng.integers(3, 9))
    springs = np.array([(i, j) for i in range(n) for j in range(i)])
    chosen = rng.random(len(springs)) < 0.6
    return ws.Robot(
        masses=10.0 ** rng.uniform(-4, 2, n),
        positions=np.round(rng.normal(0, 0.1, (n, 3)), int(rng.integers(1, 6))),
        velocities=rng.normal(0, 10.0 ** rng.uniform(-1, 3), (n, 3)),
        springs=springs[chosen],
        stiffness=10.0 ** rng.uniform(0, 7, chosen.sum()),
        faces=[rng.choice(n, 3, replace=False) for _ in range(rng.integers(0, 8))],
    )


@pytest.mark.parametrize("layout", ["lanes", "flat"])
def test_garbage_ruins_its_own_world_alone(cube, layout):
    pair = [cube, cube.rotated((1, 2, 3), 0.5).moved((0.02, 0, 0.13))]
    scene = ws.Scene(collisions=ws.Collisions())
    options = {"dt": 5e-4, "layout": layout}
    alone = ws.Simulation(pair, scene, world="together", **options).run(0.05)
    rng, worlds = np.random.default_rng(3), 12
    robots = [garbage(rng) for _ in range(2 * worlds)]
    numbers = [i // 2 for i in range(2 * worlds)]
    everybody = [*robots, *pair]
    result = ws.Simulation(everybody, scene, world=[*numbers, 99, 99], **options).run(0.05)
    assert (result.status[:-1] != ws.Status.OK).any() and result.status[-1] == ws.Status.OK
    assert np.array_equal(result.positions(worlds), alone.positions(0))
    for world in range(worlds):
        assert np.isfinite(result.positions(world)).all()


@pytest.mark.parametrize("layout", ["lanes", "flat"])
def test_a_block_on_a_tilted_block_sticks_or_slides(cube, layout):
    mu_s, mu_k, g = 0.6, 0.4, 9.81
    block = cube.replace(stiffness=1e4).moved((-0.05, -0.05, 0.01)).moved((-0.5, 0, 0))

    def simulation(robots, angle, damping, kinetic=mu_k):
        rough = ws.Collisions(thickness=0.01, static_friction=mu_s, kinetic_friction=kinetic)
        tilted = (g * np.sin(angle), 0.0, -g * np.cos(angle))
        scene = ws.Scene(gravity=tilted, ground=None, damping=damping, collisions=rough)
        return ws.Simulation(robots, scene, dt=2.5e-4, world="together", layout=layout)

    sticks = simulation([block, plate(2.0)], 0.9 * np.arctan(mu_s), 20.0, mu_s)
    before = sticks.run(1.0).positions(0)[:8]
    assert sticks.run(0.5).positions(0)[:8] == pytest.approx(before, abs=1e-7)

    angle = np.arctan(mu_s) + 0.1
    level = simulation([block, plate(2.0)], 0.0, 20.0).run(0.5).positions(0)[:8]
    slides = simulation([block.replace(positions=level), plate(2.0)], angle, 0.0).run(0.4, fps=200)
    way = slides.frames(0)[:, :8, 0].mean(axis=1)
    t = slides.times
    fit = np.linalg.lstsq(np.stack([1 + 0 * t, t, t**2 / 2], axis=1), way, rcond=None)[0]
    assert fit[2] == pytest.approx(g * (np.sin(angle) - mu_k * np.cos(angle)), rel=0.03)


@pytest.mark.parametrize(("ratio", "layout"), [(0.05, "lanes"), (0.3, "lanes"), (0.3, "flat")])
def test_restitution_and_duration_of_an_impact_are_those_of_a_damped_spring(ratio, layout):
    # Schwager and Poeschel 2007: the contact ends when its force does, before the overlap is gone.
    k, m, v, dt = 1e4, 0.1, 1.0, 2e-5
    w0 = np.sqrt(k / m)
    w = w0 * np.sqrt(1 - ratio**2)
    lasts = (np.pi - np.arctan2(2 * ratio * w0 * w, w**2 - (ratio * w0) ** 2)) / w
    keeps = np.exp(-ratio * w0 * lasts)
    options = SMOOTH | {"damping": ratio}
    collisions = ws.Collisions(thickness=0.01, stiffness=k, **options)
    scene = ws.Scene(collisions=collisions, **WEIGHTLESS)
    robots = [point((0.1, 0.05, 0.011), (0.3, 0.0, -v)), plate(mass=0.05)]  # fixed: not light
    simulation = ws.Simulation(robots, scene, dt, world="together", layout=layout)
    result = simulation.run(0.015, fps=1 / dt, energy=True)
    speed = result.velocities(0)[0]
    assert speed == pytest.approx((0.3, 0.0, keeps * v), rel=2e-3)
    lost = 0.5 * m * v**2 * (1 - keeps**2)
    assert result.energy.dashpot_loss[0, -1] == pytest.approx(lost, rel=2e-3)
    height = result.frames(0)[:, 0, 2]
    pushed = np.abs(np.diff(height, 2)) > 1e-3 * w0 * v * dt**2
    ends = np.flatnonzero(pushed)[[0, -1]]
    assert (ends[1] - ends[0]) * dt == pytest.approx(lasts, abs=3 * dt)


def jaw(side, reach=0.1):
    """A square in the plane x = side, guided along x, that a force of 1 N presses inwards."""
    corners = [(side, y, z) for y in (-reach, reach) for z in (-reach, reach)]
    springs = [(0, 1), (1, 3), (3, 2), (2, 0), (0, 3), (1, 2)]
    plate = ws.Robot(
        masses=0.05,
        positions=corners,
        springs=springs,
        stiffness=1e4,
        faces=[(0, 1, 3), (0, 3, 2)],
    )
    return plate.fixed(axes="yz").pushed(None, (-0.25 * np.sign(side), 0, 0))


def test_a_jaw_that_closes_holds_what_its_friction_can_carry():
    # Two plates with 1 N each carry 2 mu N; what is heavier slides out at g - 2 mu N / m.
    mu, g, force = 0.5, 9.81, 1.0
    ways = {}
    for share in (0.8, 2.0):
        mass = share * 2 * mu * force / g
        held = ws.shapes.cube(edge=0.05, mass=mass, stiffness=2e3)
        held = held.moved(-held.center_of_mass).rotated((1, 0, 0), 0.3)
        robots = [held, jaw(-0.045), jaw(0.045)]
        rough = ws.Collisions(
            thickness=0.01, stiffness=1e4, static_friction=mu, kinetic_friction=mu, damping=0.3
        )
        weightless = ws.Scene(gravity=(0, 0, 0), ground=None, damping=20.0, collisions=rough)
        closed = ws.Simulation(robots, weightless, dt=2e-4, world="together").run(0.4)
        x = closed.positions(0)
        assert np.abs(x[8:, 0]).max() < 0.037 < robots[2].positions[0, 0]  # they were 1 cm away
        grasp = closed.robots[0].replace(positions=x)
        scene = ws.Scene(ground=None, collisions=rough)
        fall = ws.Simulation(grasp, scene, dt=2e-4).run(0.15, fps=100).frames(0)
        ways[share] = (fall - fall[0])[:, :8, 2].mean(axis=1)
    assert np.abs(ways[0.8]).max() < 3e-4  # it gives; at a hundredth of g it would slip 1 mm
    expected = -0.5 * (g - 2 * mu * force / mass) * 0.15**2
    assert ways[2.0][-1] == pytest.approx(expected, rel=0.02)


def folded_sheet(cells=4, edge=0.05):
    """A strip, folded over in its middle: its upper half hangs 2 cm above its lower half."""
    half = [(edge * i, 0.0) for i in range(cells, 0, -1)]
    profile = [*half, (0.0, 0.01), *[(x + 0.3 * edge, 0.02) for x, _ in reversed(half)]]
    positions = [(x, y, z) for x, z in profile for y in (0.0, edge)]
    faces, springs = [], [(0, 1)]
    for i in range(len(profile) - 1):
        a, b, c, d = 2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3
        faces += [(a, c, b), (b, c, d)]
        springs += [(a, c), (b, d), (b, c), (c, d)]
    sheet = ws.Robot(
        masses=0.01, positions=positions, springs=springs, stiffness=500.0, faces=faces
    )
    return sheet.fixed(np.arange(2 * cells))


def test_a_folded_sheet_comes_to_rest_on_itself():
    k, thickness = 2e3, 0.01
    fold = ws.Collisions(thickness=thickness, stiffness=k, damping=0.3)
    scene = ws.Scene(ground=None, damping=5.0, collisions=fold)
    result = ws.Simulation(folded_sheet(), scene, dt=2e-4).run(1.5, energy=True)
    gap = result.positions(0)[12:, 2]
    # Each mass presses on what is below by its weight, and is carried by one such spring or more.
    assert gap.min() > thickness - 1.01 * 0.01 * 9.81 / k - 1e-5 and gap.max() < thickness
    assert np.abs(result.velocities(0)[12:]).max() < 1e-3
    total = result.energy.total[0]
    assert total[-1] < total[0] and result.energy.residual[0, -1] < 0.02 * (total[0] - total[-1])
    falls = ws.Simulation(folded_sheet(), ws.Scene(ground=None, damping=5.0), dt=2e-4).run(1.5)
    assert falls.positions(0)[12:, 2].max() < 0.0  # through itself, without collisions


def corner_on_corner(shift):
    """Two cubes, one of which comes down with its corner on the upper corner of the other."""
    cube = ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1e4)
    cube = cube.moved(-cube.center_of_mass)
    low = cube.rotated(np.cross((1, 1, 1), (0, 0, 1)), np.arccos(1 / np.sqrt(3)))
    high = low.rotated((1, 0, 0), np.pi).moved((*shift, 0.1 * np.sqrt(3) + 0.01))
    return [low, high.moving((0, 0, -1.0))]


@pytest.mark.parametrize(
    ("layout", "integrator"),
    [("lanes", "chin4"), ("lanes", "leapfrog"), ("lanes", "euler"), ("flat", "chin4")],
)
def test_corners_that_meet_make_no_energy_at_a_stable_step(layout, integrator):
    # All triangles and edges around both corners push at once: as stiff as collisions ever are.
    shifts = np.random.default_rng(0).normal(0, 0.0015, (6, 2))
    robots = [cube for shift in (*shifts, (0, 0)) for cube in corner_on_corner(shift)]
    pairs = np.arange(len(robots)) // 2
    for collisions in (ws.Collisions(**SMOOTH), ws.Collisions(), ws.Collisions(damping=1.0)):
        scene = ws.Scene(collisions=collisions, **WEIGHTLESS)
        bound = ws.stable_dt(robots[0], scene, integrator)
        for part, most in ((0.96, 1.6), (0.5, 1.1)):
            options = {"integrator": integrator, "layout": layout, "limits": ws.Limits(gain=9.0)}
            simulation = ws.Simulation(robots, scene, part * bound, world=pairs, **options)
            energy = simulation.run(0.04, fps=500, energy=True).energy
            assert np.ptp(energy.kinetic, axis=1).min() > 0.05  # they met
            assert (energy.total / energy.total[:, :1]).max() < most
            assert part > 0.5 or energy.gain.max() < 0.1
    auto = ws.Simulation(robots, scene, integrator=integrator, layout=layout, world=pairs)
    assert auto.robot_dt.max() <= 0.5 * bound


@pytest.mark.parametrize("layout", ["lanes", "flat"])
def test_a_bar_on_more_rails_than_friction_remembers_sticks_and_slides_all_the_same(layout):
    mu, g, rails = 0.6, 9.81, 12  # friction remembers eight pairs of an edge
    at = np.linspace(-0.55, 0.55, rails)
    fixed = [
        ws.Robot(masses=1.0, positions=[(x, -0.1, 0), (x, 0.1, 0)], springs=[(0, 1)], stiffness=1e4)
        for x in at
    ]
    ends = [(-0.9, 0.0, 0.01), (0.9, 0.0, 0.01)]
    bar = ws.Robot(masses=0.2, positions=ends, springs=[(0, 1)], stiffness=1e4)
    rough = ws.Collisions(thickness=0.01, static_friction=mu, kinetic_friction=mu, damping=0.3)

    def run(bar, slope, damping, duration):
        tilted = (g * np.sin(slope), 0.0, -g * np.cos(slope))
        scene = ws.Scene(gravity=tilted, ground=None, damping=damping, collisions=rough)
        robots = [bar, *(rail.fixed() for rail in fixed)]
        simulation = ws.Simulation(robots, scene, dt=1e-4, world="together", layout=layout)
        return simulation, simulation.run(duration, fps=100, energy=True)

    simulation, held = run(bar, 0.8 * np.arctan(mu), 20.0, 0.5)
    before, after = held.positions(0)[:2], simulation.run(0.5).positions(0)[:2]
    assert after == pytest.approx(before, abs=1e-7)
    level = run(bar, 0.0, 20.0, 0.5)[1].positions(0)[:2]
    slope = np.arctan(mu) + 0.2
    _, slides = run(bar.replace(positions=level), slope, 0.0, 0.25)
    assert slides.status[0] == ws.Status.OK and slides.energy.gain.max() < 0.01
    way = slides.frames(0)[:, :2, 0].mean(axis=1)
    fit = np.polyfit(slides.times, way, 2)
    assert 2 * fit[0] == pytest.approx(g * (np.sin(slope) - mu * np.cos(slope)), rel=0.03)
