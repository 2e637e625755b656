"""The page in a real browser: it draws what was simulated, plays, and obeys mouse, keys, touch."""

from __future__ import annotations

import dataclasses
import html
import json
import re

import numpy as np
import pytest

import warp_springs as ws
from tests.chromium import Browser
from warp_springs.view.pages.scene import LEVELS, Block, described

FPS = 30


@pytest.fixture(scope="module")
def result(cube, walker):
    """A dropped cube and two walkers, one of them with materials, for half a second."""
    dropped = cube.moved((0.0, 0.0, 0.2))
    dressed = walker.made_of(ws.materials.BONE, where=lambda middles: middles[:, 2] < 0.05)
    simulation = ws.Simulation([dropped, walker, dressed], ws.Scene(damping=0.5))
    return simulation.run(0.5, fps=FPS, energy=True)


@pytest.fixture(scope="module")
def browser():
    with Browser() as running:
        yield running


@pytest.fixture(scope="module")
def file(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "page.html"
    notes = {1: {"fitness": 0.25, "survives": True}}
    return ws.export_html(result, path, title="Three <robots>", names={1: "a & b"},
                          custom_data=notes)  # fmt: skip


@pytest.fixture
def page(browser, file):
    page = browser.open(file.as_uri(), size=(900, 600))
    page.wait("document.body.dataset.state")
    return page


def still(page):
    """Stop at the first frame and wait until that is drawn."""
    page.key("Home")
    return settled(page)


def settled(page):
    page.evaluate("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")
    return page.picture()


def changed(before, after):
    """Share of the pixels of two pictures that differ visibly."""
    return float((np.abs(before.astype(int) - after).max(axis=2) > 24).mean())


def test_it_draws_and_plays_without_a_complaint(page):
    assert page.evaluate("document.body.dataset.state") == "ready"
    clock = "document.getElementById('time').value"
    start = float(page.evaluate(clock))
    page.wait(f"{clock} != {start}")
    first = still(page)
    view = first[:500, :580]
    red, blue = view[..., 0].astype(int), view[..., 2].astype(int)
    assert (blue - red > 60).mean() > 0.005, "the skin is blue"
    assert (view.max(axis=2) < 50).mean() > 0.0005, "the masses are nearly black"
    assert len(np.unique(view.reshape(-1, 3), axis=0)) > 1000
    page.key("End")
    assert changed(first, settled(page)) > 0.003, "the last frame looks different"
    assert page.evaluate("document.getElementById('clock').textContent") == "0.50 s"
    assert page.complaints == []
    assert page.requests == [page.evaluate("location.href")], "nothing else was asked for"


def test_it_says_what_it_shows(page):
    assert page.evaluate("document.title") == "Three <robots>"
    assert page.evaluate("document.querySelector('h1').textContent") == "Three <robots>"
    page.key("n")
    facts = page.evaluate("document.getElementById('facts').innerText")
    assert re.search(r"fitness\s+0\.25", facts) and re.search(r"survives\s+yes", facts)
    assert re.search(r"masses\s+12", facts)
    assert page.evaluate("document.querySelector('#labels .chosen').textContent") == "a & b"
    assert "kinetic" in page.evaluate("document.getElementById('upper-title').textContent")


def test_keys_step_turn_and_colour(page):
    before = still(page)
    page.key("ArrowRight")
    page.key("ArrowRight")
    settled(page)
    time = float(page.evaluate("document.getElementById('time').value"))
    assert time == pytest.approx(2 / FPS, abs=1e-3)
    page.key("Home")
    for key, least in (("c", 0.002), ("s", 0.01), ("l", 0.05), ("u", 0.05), ("n", 0.1)):
        page.key(key)
        after = settled(page)
        assert changed(before, after) > least, key
        before = after
    assert page.evaluate("document.getElementById('color').value") == "material"
    assert not page.evaluate("document.getElementById('skin').checked")
    page.key("a")
    assert changed(before, settled(page)) > 0.1, "all are seen again"
    assert page.complaints == []


def test_the_camera_goes_along_unless_told_not_to(browser, cube, tmp_path):
    gone = cube.moving((3.0, 0.0, 0.0))
    result = ws.Simulation([gone], ws.Scene(ground=None, gravity=(0, 0, 0))).run(1.0, fps=10)
    page = browser.open(ws.export_html(result, tmp_path / "page.html").as_uri(), size=(800, 500))
    page.wait("document.body.dataset.state === 'ready'")
    black = [still(page)[40:370, :500].max(axis=2) < 50]
    page.key("End")
    black.append(settled(page)[40:370, :500].max(axis=2) < 50)
    page.key("Home")
    page.key("f")
    page.key("End")
    black.append(settled(page)[40:370, :500].max(axis=2) < 50)
    assert black[0].sum() > 200 and np.mean(black[0] != black[1]) < 0.002, "it stays in the middle"
    assert black[2].sum() < 20, "it has left"


def test_the_mouse_turns_and_chooses(page):
    before = still(page)
    page.drag((300, 60), (380, 90))
    turned = settled(page)
    assert changed(before, turned) > 0.05
    x, y = page.evaluate(
        "(() => { const r = document.querySelectorAll('#labels span')[2].getBoundingClientRect();"
        "return [r.left + r.width / 2, r.top - 25]; })()"
    )
    page.drag((x, y), (x, y))
    assert page.evaluate("document.getElementById('robot').value") == "2"


def test_it_works_on_a_phone(browser, file):
    page = browser.open(file.as_uri(), size=(390, 844), phone=True)
    page.wait("document.body.dataset.state === 'ready'")
    assert page.evaluate("document.documentElement.scrollWidth") == 390, "nothing sticks out"
    before = still(page)
    page.touch([(150, 200)], [(190, 200)], [(240, 210)])
    turned = settled(page)
    assert changed(before, turned) > 0.03, "one finger turns"
    page.touch([(150, 200), (210, 200)], [(120, 200), (250, 200)], [(90, 200), (280, 200)])
    assert changed(turned, settled(page)) > 0.03, "two fingers zoom"
    assert page.complaints == []


def test_it_works_in_a_sandboxed_frame(browser, result, tmp_path):
    inner = html.escape(ws.html_page(result, robots=[0]))
    outer = tmp_path / "outer.html"
    outer.write_text(
        f'<iframe sandbox="allow-scripts" width=700 height=400 srcdoc="{inner}"></iframe>'
    )
    page = browser.open(outer.as_uri(), size=(760, 460))
    dark = "masses are drawn"
    for _ in range(100):
        picture = settled(page)
        if (picture[:340, :400].max(axis=2) < 50).mean() > 0.0005:
            break
    else:
        pytest.fail(f"not so: {dark}")
    assert page.complaints == []


def test_a_frame_that_has_no_size_at_first_is_drawn_when_it_gets_one(browser, result, tmp_path):
    inner = html.escape(ws.html_page(result))
    outer = tmp_path / "outer.html"
    outer.write_text(f'<iframe width=0 height=0 style="border:0" srcdoc="{inner}"></iframe>')
    page = browser.open(outer.as_uri(), size=(760, 460))
    inside = "document.querySelector('iframe').contentWindow"
    page.wait(f"{inside}.document.body?.dataset.state === 'ready'")
    page.evaluate("Object.assign(document.querySelector('iframe'), { width: 700, height: 400 })")
    page.wait(f"{inside}.document.getElementById('stage').classList.contains('drawn')")
    picture = settled(page)[20:300, 20:400]
    assert 0.0005 < (picture.max(axis=2) < 50).mean() < 0.2, "masses on a floor, not black"


def test_the_page_holds_the_positions_and_colours_of_the_result(result):
    header, data = described(result, None, {}, {}, grid=False, spacing=None)
    arrays = Arrays(data)
    for index, robot in enumerate(header["robots"]):
        frames = result.frames(index)
        low, high = np.split(arrays(robot["motion"]).reshape(2, len(frames), -1).astype(int), 2)
        changes = (low + 256 * high)[0].astype(np.uint16).astype(np.int16)
        steps = np.cumsum(changes.astype(np.int64), axis=0).astype(np.int16)
        shown = robot["center"] + robot["quantum"] * steps.reshape(frames.shape)
        assert np.abs(shown - frames).max() <= 0.5001 * robot["quantum"]
        assert robot["quantum"] <= robot["bar"] / 64 * 1.0001
        tension = result.robots[index].tension(frames, result.times)
        stress = np.cumsum(arrays(robot["stress"]).reshape(tension.shape), axis=0, dtype=np.int8)
        expected = np.clip(tension / robot["stressScale"], -1.0, 1.0)
        assert np.abs(stress / LEVELS - expected).max() <= 0.51 / LEVELS
        for name in ("kinetic", "residual"):
            energy = getattr(result.energy, name)[index]
            np.testing.assert_allclose(arrays(robot[f"energy_{name}"]), energy, rtol=1e-6)


class Arrays:
    """Reads the block of a page as its script does."""

    def __init__(self, text):
        import base64
        import gzip

        self._data = gzip.decompress(base64.b64decode(text))

    def __call__(self, place):
        dtype = np.dtype("<" + place["type"])
        return np.frombuffer(self._data, dtype, place["count"], place["start"])


def test_the_actuation_is_the_share_of_the_rest_length(result):
    header, data = described(result, [1], {}, {}, grid=True, spacing=None)
    robot, walker = header["robots"][0], result.robots[1]
    share = walker.rest_length_at(result.times) / walker.rest_length - 1.0
    changes = Arrays(data)(robot["actuation"]).reshape(share.T.shape).T
    shown = np.cumsum(changes, axis=0, dtype=np.int8)
    assert robot["actuationScale"] == pytest.approx(np.abs(share).max())
    assert (
        np.abs(shown / LEVELS * robot["actuationScale"] - share).max()
        < 0.51 / LEVELS * np.abs(share).max()
    )


def test_materials_and_classes_of_stiffness_have_colours(result, cube):
    header, data = described(result, None, {}, {}, grid=True, spacing=None)
    names = [material["name"] for material in header["materials"]]
    assert "bone" in names and any(name.endswith("N/m") for name in names)
    bone = names.index("bone")
    assert header["materials"][bone]["color"] == pytest.approx(ws.materials.BONE.rgb)
    labels = Arrays(data)(header["robots"][2]["material"])
    np.testing.assert_array_equal(labels == bone, result.robots[2].material == 0)


def test_obstacles_and_pushes_are_drawn(browser, result, cube, tmp_path):
    pushed = cube.pushed([0], (3.0, 0.0, 0.0), duration=0.2)
    ball = ws.Sphere(center=(0.25, -0.1, 0.0), radius=0.1)
    floor = dataclasses.replace(result.scene, obstacles=(ball, ws.Plane((0, 1, 1), -0.3)))
    changed_result = dataclasses.replace(result, scene=floor, robots=[pushed])
    path = ws.export_html(changed_result, tmp_path / "page.html", robots=[0])
    page = browser.open(path.as_uri(), size=(800, 500))
    page.wait("document.body.dataset.state === 'ready'")
    red, green, blue = (still(page)[:420, :500, k].astype(int) for k in range(3))
    brown = (red - blue > 15) & (red - blue < 60) & (red > 120)
    orange = (red - blue > 110) & (green - blue > 30)
    assert brown.mean() > 0.03 and orange.sum() > 30
    page.key("End")
    assert page.evaluate("document.getElementById('clock').textContent") == "0.50 s"
    red, green, blue = (settled(page)[:420, :500, k].astype(int) for k in range(3))
    assert not ((red - blue > 110) & (green - blue > 30)).any(), "the push is over"
    assert page.complaints == []


def test_tethers_water_and_held_masses_are_drawn(browser, cube, tmp_path):
    def shown(robot, scene):
        result = ws.Simulation(robot, scene).run(0.2, fps=10)
        path = ws.export_html(result, tmp_path / "page.html")
        page = browser.open(path.as_uri(), size=(800, 500))
        page.wait("document.body.dataset.state === 'ready'")
        page.key("Home")
        seen = settled(page)[40:370, :500].astype(int)
        assert page.complaints == []
        return seen[..., 0], seen[..., 1], seen[..., 2]

    still_air = ws.Scene(gravity=(0.0, 0.0, 0.0))
    up = cube.moved((0.0, 0.0, 0.2))
    red, green, blue = shown(up.tethered([0], 1.0, point=(0.0, 0.0, 0.45)), still_air)
    assert ((red - blue > 110) & (green - blue > 30)).sum() > 30, "the rope is orange"
    red, green, blue = shown(up, still_air)
    dry = np.stack((red, green, blue))
    assert not ((red - blue > 110) & (green - blue > 30)).any()
    black = (dry.max(axis=0) < 50).sum()
    red, green, blue = shown(up.fixed(), still_air)
    assert (np.maximum(np.maximum(red, green), blue) < 50).sum() < 0.2 * black, "they are grey"
    sea = ws.Scene(gravity=(0.0, 0.0, 0.0), water=ws.Water(level=0.25))
    wet = np.stack(shown(up, sea))
    assert wet[2].mean() - wet[0].mean() > dry[2].mean() - dry[0].mean() + 20, "water is blue"


def test_broken_springs_are_no_longer_drawn(browser, breaking_rod, tmp_path):
    space = ws.Scene(ground=None, gravity=(0, 0, 0))
    result = ws.Simulation(breaking_rod, space).run(0.1, fps=100)
    page = browser.open(ws.export_html(result, tmp_path / "torn.html").as_uri(), size=(800, 500))
    page.wait("document.body.dataset.state === 'ready'")
    page.key("Home")
    colors = []
    for _ in result.times:
        middle = settled(page)[:370, :500].astype(int).min(axis=2)
        colors.append(np.ptp(middle[150:250, 240:260], axis=0).max())
        page.key("ArrowRight")
    held = [time < result.broken(0)[0] for time in result.times]
    assert any(held) and not all(held)
    assert [bool(range_ > 30) for range_ in colors] == held
    assert page.complaints == []


def test_nothing_in_a_text_escapes_into_the_page(result):
    evil = "</script><script>alert(1)</script>"
    text = ws.html_page(result, title=evil, names={0: evil}, custom_data={0: {evil: evil}})
    assert evil not in text
    header = re.search(r'id="header">(.*?)</script>', text, re.S)[1]
    assert json.loads(header)["robots"][0]["name"] == evil


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"robots": [7]}, "robot 7 was not recorded"),
        ({"names": {7: "x"}}, "names: robot 7 is not shown"),
        ({"custom_data": {7: {}}}, "custom_data: robot 7 is not shown"),
        ({"color": "heat"}, "color"),
        ({"spacing": -1.0}, "spacing"),
    ],
)
def test_bad_wishes_are_refused(result, options, words):
    with pytest.raises(ValueError, match=words):
        ws.html_page(result, **options)


def test_a_bad_path_is_refused_and_a_good_file_stays(result, tmp_path):
    with pytest.raises(ValueError, match="html"):
        ws.export_html(result, tmp_path / "page.txt")
    path = tmp_path / "page.html"
    path.write_text("before")
    with pytest.raises(ValueError):
        ws.export_html(result, path, robots=[9])
    assert path.read_text() == "before"
    assert ws.export_html(result, path) == path
    assert path.read_bytes() == ws.export_html(result, path).read_bytes(), "the same again"


def test_nine_robots_of_three_seconds_stay_small(tmp_path):
    rng = np.random.default_rng(4)
    bodies = []
    for _ in range(9):
        mask = rng.random((3, 3, 2)) < 0.75
        mask[1, 1, :] = True
        body = ws.shapes.voxels(mask, edge=0.1, stiffness=3000.0)
        phase = rng.uniform(0.0, 6.0, body.n_springs)
        bodies.append(body.replace(amplitude=0.1 * body.rest_length, phase=phase, omega=6.28))
    result = ws.Simulation(bodies, ws.Scene(damping=1.0)).run(3.0, fps=30)
    size = ws.export_html(result, tmp_path / "zoo.html").stat().st_size
    assert len(result.times) == 91 and size < 600_000


def test_the_block_knows_where_its_arrays_are():
    block = Block()
    places = [block.add([1, 2, 3], "u1"), block.add([-5.5], "f4"), block.add([[7, -8]], "i2")]
    read = Arrays(block.text())
    assert [read(place).tolist() for place in places] == [[1, 2, 3], [-5.5], [7, -8]]
