"""Obstacles as meshes: their points lie on the surface, their triangles face outwards."""

import numpy as np
import pytest

import warp_springs as ws
from warp_springs.view.pictures.solids import obstacle_mesh

BOX = np.array([[-1.0, -0.5, 0.0], [0.5, 0.5, 0.4]])


def volume(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6.0)


def normals(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def test_a_ball_has_its_radius_and_volume():
    ball = ws.Sphere(center=(0.3, -0.2, 0.1), radius=0.5)
    points, triangles = obstacle_mesh(ball, BOX)
    np.testing.assert_allclose(np.linalg.norm(points - ball.center, axis=1), 0.5)
    assert volume(points, triangles) == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=0.01)


def test_a_turned_box_has_its_size_and_volume():
    box = ws.Box(center=(1.0, 2.0, 3.0), size=(0.2, 0.4, 0.6), axis=(1, 1, 0), angle=0.5)
    points, triangles = obstacle_mesh(box, BOX)
    own = (points - box.center) @ box.rotation
    np.testing.assert_allclose(np.abs(own), np.tile((0.1, 0.2, 0.3), (8, 1)))
    assert volume(points, triangles) == pytest.approx(0.2 * 0.4 * 0.6)


def test_a_plane_lies_under_the_box_and_faces_along_its_normal():
    plane = ws.Plane(normal=(1.0, 0.0, 2.0), offset=0.3)
    points, triangles = obstacle_mesh(plane, BOX)
    np.testing.assert_allclose(points @ plane.normal, plane.offset, atol=1e-12)
    assert (normals(points, triangles) @ plane.normal > 0.0).all()
    sideways = points.mean(axis=0) - BOX.mean(axis=0)
    np.testing.assert_allclose(np.cross(sideways, plane.normal), 0.0, atol=1e-12)


def test_terrain_has_its_heights_and_faces_up():
    heights = np.random.default_rng(2).random((4, 6))
    field = ws.HeightField(heights, spacing=0.25, origin=(-0.5, 0.1, 0.05))
    points, triangles = obstacle_mesh(field, BOX)
    np.testing.assert_allclose(points.reshape(4, 6, 3)[2, 3], [0.0, 0.85, heights[2, 3] + 0.05])
    assert (normals(points, triangles)[:, 2] > 0.0).all() and len(triangles) == 2 * 3 * 5
