"""Mesh files: hand-written ones of several formats, round trips, broken files, series."""

import math
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

import warp_springs as ws
from tests.warp_springs.test_shapes import assert_closed
from warp_springs.materials import BONE, MUSCLE, NYLON, TISSUE

# -- files as other programs write them ------------------------------------------------------

GMSH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
3 1 "bone"
3 2 "jelly"
$EndPhysicalNames
$Nodes
6
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 1 1 1
6 9 9 9
$EndNodes
$Elements
3
1 4 2 1 1 1 2 3 4
2 4 2 2 1 2 3 4 5
3 2 2 1 1 1 2 3
$EndElements
"""
OBJ = """# a unit square with a quad and a triangle on it, as modelling programs write them
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0.5 0.5 1
f 1 2 3 4
f 1 2 5
"""
STL = """solid corner
facet normal 0 0 -1
 outer loop
  vertex 0 0 0
  vertex 0 10 0
  vertex 10 0 0
 endloop
endfacet
facet normal 0 -1 0
 outer loop
  vertex 0 0 0
  vertex 10 0 0
  vertex 0 0 10
 endloop
endfacet
facet normal -1 0 0
 outer loop
  vertex 0 0 0
  vertex 0 0 10
  vertex 0 10 0
 endloop
endfacet
facet normal 1 1 1
 outer loop
  vertex 10 0 0
  vertex 0 10 0
  vertex 0 0 10
 endloop
endfacet
endsolid corner
"""
ABAQUS = """*HEADING
two bars and a brick
*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
9, 2., 0., 0.
*ELEMENT, TYPE=C3D8, ELSET=Muscle
1, 1, 2, 3, 4, 5, 6, 7, 8
*ELEMENT, TYPE=T3D2, ELSET=Wire
2, 2, 9
3, 3, 9
"""
MEDIT = """MeshVersionFormatted 2
Dimension 3
Vertices
4
0 0 0 0
1 0 0 0
0 1 0 0
0 0 1 0
Tetrahedra
1
1 2 3 4 7
End
"""
VTK = """# vtk DataFile Version 3.0
a wedge and a pyramid
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 7 double
0 0 0
1 0 0
0 1 0
0 0 1
1 0 1
0 1 1
2 2 0.5
CELLS 2 13
6 0 1 2 3 4 5
5 1 2 5 4 6
CELL_TYPES 2
13
14
"""
FILES = {
    "two.msh": GMSH,
    "roof.obj": OBJ,
    "corner.stl": STL,
    "brick.inp": ABAQUS,
    "one.mesh": MEDIT,
    "house.vtk": VTK,
}


@pytest.fixture
def folder(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def pairs(robot):
    return {tuple(pair) for pair in robot.springs.tolist()}


def test_gmsh_tetrahedra_with_named_regions(folder):
    robot = ws.read_mesh(folder / "two.msh", mass=2.0, stiffness=70.0)
    assert robot.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
    assert pairs(robot) == {(i, j) for j in range(5) for i in range(j)} - {(0, 4)}
    assert robot.mass == pytest.approx(2.0)
    assert [m.name for m in robot.materials] == ["bone", "jelly"]
    assert robot.materials[0] is BONE  # the file calls it by a name that is known here
    jelly = robot.springs[:, 1] == 4
    assert robot.material.tolist() == jelly.astype(int).tolist()  # shared edges are the first's
    assert set(robot.stiffness[jelly]) == {70.0} and set(robot.stiffness[~jelly]) == {20_000.0}
    assert len(robot.faces) == 6  # the triangle of the file is a side of the first tetrahedron
    assert robot.volume == pytest.approx(1 / 6 + 1 / 3)
    assert_closed(robot)


def test_gmsh_regions_by_mapping(folder):
    by_name = ws.read_mesh(folder / "two.msh", materials={"jelly": TISSUE, "bone": MUSCLE})
    assert [m.name for m in by_name.materials] == ["muscle", "tissue"]
    assert by_name.is_actuated
    with pytest.raises(ValueError, match=r"two.msh: materials: no cell is labelled 'wood'"):
        ws.read_mesh(folder / "two.msh", materials={"wood": TISSUE})
    with pytest.raises(ValueError, match=r"brick.inp.*label.*no cell data 'stuff'"):
        ws.read_mesh(folder / "brick.inp", label="stuff")


def test_obj_quads_and_triangles(folder):
    robot = ws.read_mesh(folder / "roof.obj", diagonals=False)
    around = {(0, 1), (1, 2), (2, 3), (0, 3), (0, 4), (1, 4)}
    assert pairs(robot) == around
    assert pairs(ws.read_mesh(folder / "roof.obj")) == around | {(0, 2), (1, 3)}
    assert {frozenset(face) for face in robot.faces.tolist()} == {
        frozenset(face) for face in ((0, 1, 2), (0, 2, 3), (0, 1, 4))
    }


def test_stl_in_millimetres_is_welded(folder):
    robot = ws.read_mesh(folder / "corner.stl", scale="mm")
    assert (robot.n_masses, robot.n_springs, len(robot.faces)) == (4, 6, 4)
    assert robot.bounds[1] == pytest.approx([0.01, 0.01, 0.01])
    assert robot.volume == pytest.approx(1e-6 / 6)
    assert robot.volume == pytest.approx(ws.read_mesh(folder / "corner.stl", scale=0.001).volume)
    assert_closed(robot)
    solid = ws.shapes.filled(robot, 0.003)
    assert solid.n_masses > 4


def test_abaqus_brick_with_bars_and_element_sets(folder):
    robot = ws.read_mesh(folder / "brick.inp", materials={"Wire": NYLON})
    assert robot.n_springs == 28 + 2
    assert ws.read_mesh(folder / "brick.inp", diagonals=False).n_springs == 12 + 2
    names = [robot.materials[i].name for i in robot.material]
    assert names.count("muscle") == 28 and names.count("nylon") == 2
    wire = robot.stiffness[np.array(names) == "nylon"]
    assert wire == pytest.approx(NYLON.modulus * NYLON.section / np.array([1, math.sqrt(2)]))
    assert len(robot.faces) == 12 and robot.volume == pytest.approx(1.0)


def test_medit_labels_are_numbers(folder):
    robot = ws.read_mesh(folder / "one.mesh", materials={7: BONE}, density=600.0)
    assert robot.materials == (BONE,)
    assert robot.masses == pytest.approx(np.full(4, 600.0 / 6 / 4))


def test_vtk_wedge_and_pyramid(folder):
    robot = ws.read_mesh(folder / "house.vtk", diagonals=False)
    assert robot.n_springs == 9 + 4
    assert len(robot.faces) == (2 + 2 * 2) + 4  # the side that the two share is inside
    pyramid = 1.0 / 3.0 * math.sqrt(2) * (3.0 / math.sqrt(2))  # base times height
    assert robot.volume == pytest.approx(0.5 + pyramid)
    assert_closed(robot)


def test_a_density_needs_volumes(folder):
    with pytest.raises(ValueError, match=r"roof.obj: density: mass 0 belongs to no cell"):
        ws.read_mesh(folder / "roof.obj", density=1000.0)


# -- what meshio makes -----------------------------------------------------------------------


def regular(kind, n):
    """Points and cells of a block of n^3 unit cubes: hexahedra, or six tetrahedra each."""
    body = ws.shapes.lattice(n, n, n, edge=1.0)
    corner = np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    a = corner[:-1, :-1, :-1].ravel()
    x, y, z = (n + 1) ** 2, n + 1, 1
    cube = a[:, None] + np.array([0, x, x + y, y, z, x + z, x + y + z, y + z])
    if kind == "hexahedron":
        return body, [("hexahedron", cube)]
    tetra = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
    return body, [("tetra", cube[:, tetra].reshape(-1, 4))]


def test_hexahedra_are_the_lattice(tmp_path):
    body, cells = regular("hexahedron", 3)
    meshio.Mesh(body.positions, cells).write(tmp_path / "block.vtu")
    robot = ws.read_mesh(tmp_path / "block.vtu", mass=6.4, stiffness=1000.0)
    assert np.array_equal(robot.springs, body.springs)
    assert np.array_equal(robot.positions, body.positions)
    assert robot.mass == pytest.approx(body.mass)
    assert len(robot.faces) == len(body.faces) and robot.volume == pytest.approx(27.0)
    edges = ws.read_mesh(tmp_path / "block.vtu", diagonals=False)
    assert edges.n_springs == 3 * 3 * 4 * 4
    heavy = ws.read_mesh(tmp_path / "block.vtu", density=800.0)
    assert heavy.mass == pytest.approx(27.0 * 800.0)
    assert heavy.masses.max() == pytest.approx(8 * heavy.masses.min())  # inside, and at a corner


def test_tetrahedra_by_euler(tmp_path):
    """V - E + F - C = 1 for a ball cut into tetrahedra."""
    body, cells = regular("tetra", 3)
    tangled = cells[0][1].copy()
    tangled[::2, [0, 1]] = tangled[::2, [1, 0]]  # programs disagree about the order of corners
    meshio.Mesh(body.positions, [("tetra", tangled)]).write(tmp_path / "block.vtk")
    robot = ws.read_mesh(tmp_path / "block.vtk")
    skin, count = len(robot.faces), len(tangled)
    assert robot.n_masses - robot.n_springs + (4 * count + skin) // 2 - count == 1
    assert skin == 12 * 9 and robot.volume == pytest.approx(27.0)
    assert_closed(robot)


def test_nodes_within_edges_are_left_out(tmp_path):
    points = np.vstack([np.zeros(3), np.eye(3)])
    middles = [
        (points[i] + points[j]) / 2 for i, j in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    ]
    mesh = meshio.Mesh(np.vstack([points, middles]), [("tetra10", np.arange(10)[None])])
    mesh.write(tmp_path / "one.vtu")
    robot = ws.read_mesh(tmp_path / "one.vtu")
    assert (robot.n_masses, robot.n_springs, len(robot.faces)) == (4, 6, 4)


def test_a_surface_inside_out_is_turned(tmp_path):
    cube = ws.shapes.cube()
    meshio.Mesh(cube.positions, [("triangle", cube.faces[:, ::-1])]).write(tmp_path / "out.ply")
    assert ws.read_mesh(tmp_path / "out.ply").volume == pytest.approx(1e-3)


# -- round trips -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def robot():
    body = ws.shapes.lattice(2, 1, 1, stiffness=500.0).made_of(TISSUE)
    return body.made_of(MUSCLE, where=[3, 4]).spinning((1, 2, 3)).moved((0.1, 0.2, 0.3))


def same_body(read, robot, atol):
    order = np.lexsort(np.round(read.positions, 5).T), np.lexsort(np.round(robot.positions, 5).T)
    rank = [np.argsort(o) for o in order]
    assert read.positions[order[0]] == pytest.approx(robot.positions[order[1]], abs=atol)
    found, wanted = (
        {tuple(sorted(pair)) for pair in r[body.springs].tolist()}
        for r, body in zip(rank, (read, robot), strict=True)
    )
    assert found <= wanted
    assert read.volume == pytest.approx(robot.volume, rel=1e-5)
    assert len(read.faces) == len(robot.faces)
    return found == wanted


@pytest.mark.parametrize(
    "suffix", ["vtu", "vtk", "xdmf", "msh", "mesh", "inp", "bdf", "mdpa", "med", "vol", "post"]
)
def test_springs_and_skin_come_back(robot, tmp_path, suffix):
    path = tmp_path / f"robot.{suffix}"
    assert ws.write_mesh(robot, path) == [path]
    assert same_body(ws.read_mesh(path), robot, 1e-9)
    assert [p.name for p in tmp_path.iterdir() if p != path and p.suffix != ".h5"] == []


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "off"])
def test_the_skin_comes_back(robot, tmp_path, suffix):
    path = tmp_path / f"robot.{suffix}"
    ws.write_mesh(robot, path)
    read = ws.read_mesh(path)
    assert not same_body(read, robot, 1e-6)  # the springs inside are lost
    assert read.n_springs == 30


@pytest.mark.parametrize("suffix", ["vtu", "vtk", "xdmf", "med"])
def test_data_come_back(robot, tmp_path, suffix):
    path = tmp_path / f"robot.{suffix}"
    ws.write_mesh(robot, path)
    read = ws.read_mesh(path, materials={1: TISSUE, 2: MUSCLE})
    for name in ("masses", "velocities", "stiffness", "rest_length", "amplitude", "phase"):
        assert getattr(read, name) == pytest.approx(getattr(robot, name), rel=1e-12), name
    assert [read.materials[i] for i in read.material] == [
        robot.materials[i] for i in robot.material
    ]
    twice = ws.read_mesh(path, scale=2.0)
    assert twice.rest_length == pytest.approx(2.0 * robot.rest_length)
    assert twice.stiffness == pytest.approx(robot.stiffness)


@pytest.mark.parametrize("suffix", ["vtu", "vtk", "xdmf", "med"])
def test_a_skin_that_no_springs_border_adds_none(robot, tmp_path, suffix):
    edges = np.sort(robot.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1).tolist()
    kept = np.array([sorted(pair) not in edges[:5] for pair in robot.springs.tolist()])
    assert kept.sum() == robot.n_springs - 5
    bare = ws.Robot(masses=robot.masses, positions=robot.positions, springs=robot.springs[kept],
                    stiffness=robot.stiffness[kept], faces=robot.faces)  # fmt: skip
    ws.write_mesh(bare, tmp_path / f"bare.{suffix}")
    read = ws.read_mesh(tmp_path / f"bare.{suffix}")
    assert read.n_springs == bare.n_springs and len(read.faces) == len(robot.faces)
    assert read.stiffness == pytest.approx(bare.stiffness, rel=1e-12)


def test_labels_come_back_from_gmsh(robot, tmp_path):
    ws.write_mesh(robot, tmp_path / "robot.msh")
    read = ws.read_mesh(tmp_path / "robot.msh", materials={1: TISSUE, 2: MUSCLE})
    assert np.array_equal(read.material, robot.material)


# -- what is written -------------------------------------------------------------------------


def test_tension_stretch_and_stress_are_right(tmp_path):
    rod = ws.Material("rod", modulus=1e6, section=1e-4)
    pair = ws.Robot(
        masses=1, positions=[(0, 0, 0), (2, 0, 0)], springs=[(0, 1)], stiffness=1, rest_length=1.6
    ).made_of(rod)
    ws.write_mesh(pair, tmp_path / "rod.vtu")
    data = {
        name: value[0][0] for name, value in meshio.read(tmp_path / "rod.vtu").cell_data.items()
    }
    assert data["tension"] == pytest.approx(1e6 * 1e-4 / 1.6 * 0.4)
    assert data["stretch"] == pytest.approx(2.0 / 1.6)
    assert data["stress"] == pytest.approx(1e6 * 0.25)  # E times the strain
    assert data["material"] == 1


@pytest.fixture(scope="module")
def result():
    cube = ws.shapes.cube(stiffness=5000.0)
    cubes = [cube.moved((0, 0, h)) for h in (0.05, 0.1)]
    return ws.Simulation(cubes, ws.Scene(), dt=5e-4).run(0.2, fps=20, record=[1])


def test_frames_of_a_result(result, tmp_path):
    ws.write_mesh(result, tmp_path / "end.vtu", robot=1)
    end = meshio.read(tmp_path / "end.vtu")
    assert np.array_equal(end.points, result.positions(1))
    assert np.array_equal(end.point_data["velocity"], result.velocities(1))
    ws.write_mesh(result, tmp_path / "third.vtu", robot=1, frame=2)
    third = meshio.read(tmp_path / "third.vtu")
    assert np.array_equal(third.points, result.frames(1)[2])
    assert third.cell_data["tension"][0] == pytest.approx(
        result.robots[1].tension(result.frames(1)[2], result.times[2])
    )
    files = ws.write_mesh(result, tmp_path / "skin.ply", robot=1, frame="all")
    assert [f.name for f in files] == [f"skin_000{i}.ply" for i in range(5)]
    skin = meshio.read(files[4])
    assert skin.points == pytest.approx(result.frames(1)[4], abs=1e-6)
    forces = result.robots[1].tension(result.frames(1)[4], result.times[4])
    of_each = [forces[(result.robots[1].springs == i).any(axis=1)].mean() for i in range(8)]
    assert skin.point_data["tension"] == pytest.approx(of_each, rel=1e-5)


def test_a_pvd_lists_the_frames_with_their_times(result, tmp_path):
    first, *parts = ws.write_mesh(result, tmp_path / "run.pvd", robot=1)
    sets = ElementTree.parse(first).getroot().findall("Collection/DataSet")
    assert [float(s.get("timestep")) for s in sets] == pytest.approx(result.times)
    assert [s.get("file") for s in sets] == [p.name for p in parts]
    for i in (0, 4):
        assert np.array_equal(meshio.read(parts[i]).points, result.frames(1)[i])


def test_an_xdmf_holds_all_frames(result, tmp_path):
    (path,) = ws.write_mesh(result, tmp_path / "run.xdmf", robot=1, frame="all")
    root = ElementTree.parse(path).getroot()
    grids = root.findall("Domain/Grid/Grid")
    times = [float(g.find("Time").get("Value")) for g in grids]
    assert times == pytest.approx(result.times)
    for grid, wanted in zip(grids, result.frames(1), strict=True):
        item = grid.find("Geometry/DataItem")
        points = np.array(item.text.split(), float).reshape(
            [int(n) for n in item.get("Dimensions").split()]
        )
        assert np.array_equal(points, wanted)
        assert {a.get("Name") for a in grid.findall("Attribute")} >= {"tension", "stretch", "mass"}
    numbers = np.array(grids[0].find("Topology/DataItem").text.split(), int)
    assert len(numbers) == 28 * 4 + 12 * 4
    # The others point to the cells of the first.
    where = grids[3].find("Topology/DataItem").text.removeprefix("/Xdmf/")
    assert root.find(where) is grids[0].find("Topology/DataItem")


def test_what_cannot_be_written(robot, result, tmp_path):
    chain = ws.shapes.chain()
    for source, name, options, message in [
        (robot, "x.docx", {}, "no mesh format ends in '.docx'"),
        (chain, "x.stl", {}, "of which this robot has none"),
        (
            chain.replace(
                springs=[],
                stiffness=1.0,
                rest_length=None,
                amplitude=None,
                phase=None,
                material=None,
            ),
            "x.vtu",
            {},
            "neither springs nor faces",
        ),
        (robot, "x.vtu", {"frame": 3}, "a robot has no frames"),
        (result, "x.vtu", {"robot": 1, "frame": 5}, "has 5 frames"),
        (result, "x.vtu", {"robot": 0, "frame": 0}, "was not recorded"),
    ]:
        with pytest.raises(ValueError, match=message):
            ws.write_mesh(source, tmp_path / name, **options)
    with pytest.raises(NotADirectoryError, match="there is no folder"):
        ws.write_mesh(robot, tmp_path / "nowhere" / "x.vtu")
    assert list(tmp_path.iterdir()) == []


# -- broken files ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "suffix", ["vtu", "vtk", "msh", "stl", "ply", "obj", "off", "mesh", "inp", "bdf", "xdmf"]
)
def test_files_of_garbage_are_named(tmp_path, suffix, capfd):
    path = tmp_path / f"broken.{suffix}"
    for content in (b"", b"\x00\xff\x80 garbage \x01" * 50, b"$Nodes\nseven\n*NODE\n1, x\nv a b\n"):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=f"broken.{suffix}: "):
            ws.read_mesh(path)
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("suffix", ["vtu", "vtk", "msh", "ply", "off", "mesh", "xdmf"])
def test_files_that_are_cut_off_are_named(robot, tmp_path, suffix):
    path = tmp_path / f"cut.{suffix}"
    ws.write_mesh(robot, path)
    content = path.read_bytes()
    for share in (0.1, 0.4, 0.6):
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(ValueError, match=f"cut.{suffix}: "):
            ws.read_mesh(path)


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("roof.obj", "f 1 2 5", "f 1 2 17", "triangle 0 names node 16, but there are 5 nodes"),
        ("one.mesh", "0 0 1 0", "0 0 nan 0", "node 3 is not at a finite place"),
        ("house.vtk", "13\n14", "1\n1", "house.vtk"),
        ("roof.obj", "f 1 2 3 4\nf 1 2 5\n", "", "roof.obj: "),
    ],
)
def test_what_is_wrong_in_a_file_is_said(folder, name, old, new, message):
    assert old in FILES[name]
    (folder / name).write_text(FILES[name].replace(old, new))
    with pytest.raises(ValueError, match=message):
        ws.read_mesh(folder / name)


def test_files_that_are_not_there(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none.vtu: there is no such file"):
        ws.read_mesh(tmp_path / "none.vtu")
    (tmp_path / "page.html").write_text("<p>")
    with pytest.raises(ValueError, match=r"page.html: no mesh format ends in '.html'"):
        ws.read_mesh(tmp_path / "page.html")
    with pytest.raises(ValueError, match="scale"):
        ws.read_mesh(tmp_path / "none.vtu", scale="furlong")
