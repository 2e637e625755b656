"""Filled surfaces, balls, beams and chains: against closed forms and what a solid must be."""

import math

import numpy as np
import pytest

import warp_springs as ws
from tests.warp_springs.test_shapes import assert_closed, assert_springs_in_order
from warp_springs import shapes
from warp_springs.shapes.surface import closed_surface, components, inside, sphere_surface


def torus(major=1.0, minor=0.3, n=48, m=20):
    """Vertices and outward triangles of a torus about z."""
    u, v = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b = 2 * np.pi * u / n, 2 * np.pi * v / m
    radius = major + minor * np.cos(b)
    points = np.stack([radius * np.cos(a), radius * np.sin(a), minor * np.sin(b)], axis=-1)
    number = u * m + v
    here, up = number, np.roll(number, -1, axis=1)
    next_, both = np.roll(number, -1, axis=0), np.roll(np.roll(number, -1, axis=0), -1, axis=1)
    quads = np.stack([here, next_, both, here, both, up], axis=-1)
    return points.reshape(-1, 3), quads.reshape(-1, 3)


def in_torus(points, major=1.0, minor=0.3):
    ring = np.hypot(points[:, 0], points[:, 1]) - major
    return np.hypot(ring, points[:, 2]) - minor  # negative inside


# -- inside ----------------------------------------------------------------------------------


def test_inside_a_torus():
    points = np.random.default_rng(1).uniform(-1.4, 1.4, (50_000, 3)) * (1, 1, 0.3)
    depth = in_torus(points)
    clear = np.abs(depth) > 0.02  # the triangles cut the corners of the torus
    found = inside(points, *torus())
    assert np.array_equal(found[clear], depth[clear] < 0.0)


def test_inside_has_no_cracks_along_edges_and_vertices():
    """Points above vertices and edges of a lattice, where rays meet several triangles at once."""
    box = shapes.lattice(4, 3, 2, edge=1.0)
    points = np.array(np.meshgrid(np.arange(0.5, 4, 0.5), np.arange(0.5, 3, 0.5), [0.5, 1.0]))
    assert inside(points.reshape(3, -1).T, box.positions, box.faces).all()
    around = np.array(np.meshgrid(np.arange(-1, 6.0), np.arange(-1, 5.0), [-1.0, 3.0]))
    assert not inside(around.reshape(3, -1).T, box.positions, box.faces).any()


def test_two_bodies_that_overlap_are_one_inside():
    one, two = shapes.cube(1.0), shapes.cube(1.0).moved((0.5, 0, 0))
    both = one.joined(two)
    x = np.array([0.25, 0.75, 1.25, 1.75])
    points = np.stack([x, np.full(4, 0.4), np.full(4, 0.3)], axis=1)
    assert inside(points, both.positions, both.faces).tolist() == [True, True, True, False]


# -- surfaces --------------------------------------------------------------------------------


def test_a_surface_in_loose_triangles_is_welded():
    points, faces = torus()
    welded, triangles = closed_surface(
        points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    )
    assert len(welded) == len(points) and len(triangles) == len(faces)


def test_a_surface_inside_out_is_turned():
    points, faces = torus()
    turned = closed_surface(points, faces[:, ::-1])
    assert (
        ws.Robot(masses=1, positions=turned[0], springs=[], stiffness=1.0, faces=turned[1]).volume
        > 0
    )


def test_open_surfaces_are_refused():
    points, faces = torus()
    with pytest.raises(ValueError, match="not closed; 3 edges of its 1919 triangles"):
        shapes.filled((points, faces[1:]), 0.2)
    with pytest.raises(ValueError, match="no triangles"):
        shapes.filled(shapes.chain(), 0.2)


# -- filled ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [None, 4])
def test_a_filled_torus_is_a_solid_with_a_hole(seed):
    body = shapes.filled(torus(), 0.1, seed=seed, mass=2.0, stiffness=40.0)
    assert components(body.n_masses, body.springs) == 1
    assert np.bincount(body.springs.ravel()).min() >= 4
    assert body.n_masses > len(torus()[0]) + 100
    ends = body.positions[body.springs]
    along = np.linspace(0.0, 1.0, 9)[:, None, None]
    trace = (1 - along) * ends[:, 0] + along * ends[:, 1]
    assert in_torus(trace.reshape(-1, 3)).max() < 0.01  # no spring crosses the hole
    assert body.mass == pytest.approx(2.0)
    assert set(body.stiffness) == {40.0}
    assert_springs_in_order(body)
    assert_closed(body)
    if seed is not None:
        assert body == shapes.filled(torus(), 0.1, seed=seed, mass=2.0, stiffness=40.0)
        assert body != shapes.filled(torus(), 0.1, seed=seed + 1, mass=2.0, stiffness=40.0)


def test_limbs_that_lie_close_together_are_not_tied():
    """A U of voxels: its arms are 0.1 m apart, the reach is 0.14 m."""
    mask = np.ones((3, 1, 3), bool)
    mask[1, 0, 1:] = False
    body = shapes.filled(shapes.voxels(mask), 0.08)
    ends = body.positions[body.springs]
    higher = ends[:, :, 2].min(axis=1) > 0.1 + 1e-9
    left = (ends[higher][:, :, 0] < 0.15).sum(axis=1)
    assert set(left) == {0, 2}


def test_masses_inside_keep_their_distance_from_the_skin():
    body = shapes.filled(shapes.lattice(3, 2, 1), 0.03)
    within = body.positions[len(shapes.lattice(3, 2, 1).positions) :]
    assert len(within) > 50
    assert (within >= 0.3 * 0.03).all() and (within <= np.array([0.3, 0.2, 0.1]) - 0.3 * 0.03).all()


def test_a_spacing_that_is_too_coarse_is_refused():
    with pytest.raises(ValueError, match="fall apart"):
        shapes.filled(sphere_surface(1.0, 1), 0.25, reach=1.0, seed=1)


# -- balls, beams, chains --------------------------------------------------------------------


@pytest.mark.parametrize("n", range(4))
def test_sphere(n):
    ball = shapes.sphere(radius=0.2, subdivisions=n, mass=3.0, stiffness=70.0)
    assert len(ball.faces) == 20 * 4**n
    skin = np.unique(ball.faces)
    assert len(skin) == 10 * 4**n + 2  # Euler: V - E + F = 2
    centre = np.array([0.0, 0.0, ball.positions[skin, 2].mean()])
    assert np.linalg.norm(ball.positions[skin] - centre, axis=1) == pytest.approx(0.2)
    assert ball.bounds[0, 2] == 0.0
    assert ball.mass == pytest.approx(3.0)
    assert ball.volume == pytest.approx(4 / 3 * math.pi * 0.2**3, rel=0.6 / 4**n)
    assert np.bincount(ball.springs.ravel()).min() >= 6
    assert_closed(ball)
    assert_springs_in_order(ball)


def test_a_ball_bounces_straight_up():
    ball = shapes.sphere(mass=0.5, stiffness=3000.0, subdivisions=1).moved((0, 0, 0.2))
    result = ws.Simulation(ball, ws.Scene()).run(0.5)
    assert result.status.tolist() == [ws.Status.OK]
    assert result.center_of_mass[0, :2] == pytest.approx([0, 0], abs=1e-9)


def test_snake():
    snake = shapes.snake(segments=5, edge=0.2, span=3, mass=3.0, stiffness=7.0, cable=9.0)
    assert snake.bounds.tolist() == [[0, 0, 0], [pytest.approx(1.0), 0.2, 0.2]]
    assert snake.mass == pytest.approx(3.0)
    cables = snake.elements.slope == 0.0
    assert cables.sum() == 4 * 3 and cables[-12:].all()
    assert (snake.stiffness == np.where(cables, 9.0, 7.0)).all()
    ends = snake.positions[snake.springs[cables]]
    np.testing.assert_allclose(ends[:, 1] - ends[:, 0], [[0.6, 0.0, 0.0]] * 12, atol=1e-12)
    assert len(np.unique(ends[:, 0, 1:].round(6), axis=0)) == 4, "one row along each long edge"
    with pytest.raises(ValueError, match="span: got 6, expected at most segments = 5"):
        shapes.snake(segments=5, span=6)


def test_beam():
    beam = shapes.beam(2.0, 0.3, 0.1, cells=(8, 2, 1), mass=4.0, stiffness=9.0)
    assert beam.bounds.tolist() == [[0, 0, 0], [2.0, pytest.approx(0.3), 0.1]]
    assert beam.n_springs == shapes.lattice(8, 2, 1).n_springs
    assert beam.volume == pytest.approx(0.06)
    assert beam.mass == pytest.approx(4.0)
    assert np.array_equal(beam.rest_length, beam.lengths)


def test_chain_of_springs_in_series():
    """Pulled at both ends by F, n springs of stiffness k are longer by n F / k."""
    chain = shapes.chain(links=4, length=2.0, mass=0.5, stiffness=100.0)
    assert chain.positions[:, 0].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert chain.mass == pytest.approx(0.5)
    stretched = np.linspace(0.0, 2.4, 5)[:, None] * [1, 0, 0]
    assert chain.tension(stretched, 0.0) == pytest.approx(100.0 / 4 * 0.4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: shapes.sphere(0.0), "radius"),
        (lambda: shapes.sphere(subdivisions=-1), "subdivisions"),
        (lambda: shapes.sphere(subdivisions=7), "at most 6"),
        (lambda: shapes.beam(cells=(1, 0, 1)), r"cells\[1\]"),
        (lambda: shapes.beam(cells=3), "cells"),
        (lambda: shapes.beam(height=-1.0), "height"),
        (lambda: shapes.chain(links=0), "links"),
        (lambda: shapes.chain(mass=math.inf), "mass"),
        (lambda: shapes.filled(shapes.cube(), -1.0), "spacing"),
        (lambda: shapes.filled(shapes.cube(), 0.1, reach=0.5), "reach"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()
