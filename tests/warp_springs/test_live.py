"""The live server: it answers what it should, to whom it should, and ends."""

from __future__ import annotations

import http.client
import json
import math
import socket

import pytest

import warp_springs as ws
from tests.chromium import Browser


@pytest.fixture
def live():
    with ws.LiveServer("A <run>") as server:
        yield server


def ask(live, path, method="GET", host=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", live.port, timeout=10)
    host = f"127.0.0.1:{live.port}" if host is None else host
    connection.putrequest(method, path, skip_host=True)
    for name, value in {"Host": host, **headers}.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def test_it_listens_on_the_loopback_address_only(live):
    assert live.url == f"http://127.0.0.1:{live.port}/"
    assert live._server.socket.getsockname()[0] == "127.0.0.1"


def test_it_answers_three_addresses_and_nothing_else(live):
    live.show_robots("<p>robots</p>")
    for path, kind in (
        ("/", "text/html"),
        ("/state", "application/json"),
        ("/robots", "text/html"),
    ):
        answer, body = ask(live, path)
        assert answer.status == 200 and answer.getheader("Content-Type").startswith(kind)
        assert body and len(body) == int(answer.getheader("Content-Length"))
    for path in ("/etc/passwd", "/../../etc/passwd", "//etc/passwd", "/state/", "/live.js",
                 "/%2e%2e/state", "/.", "/run.toml", "http://example.org/"):  # fmt: skip
        assert ask(live, path)[0].status == 404, path
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "CONNECT"):
        assert ask(live, "/", method)[0].status in (404, 405, 501), method
    head, body = ask(live, "/", "HEAD")
    assert head.status == 200 and body == b"" and int(head.getheader("Content-Length")) > 1000


@pytest.mark.parametrize(
    "host",
    ["evil.example:{}", "127.0.0.1.evil.example:{}", "127.0.0.1:1", "", "127.0.0.1", "[::1]:{}"],
)
def test_a_page_elsewhere_cannot_read_it_by_a_name_of_its_own(live, host):
    answer, body = ask(live, "/state", host=host.format(live.port))
    assert answer.status == 403 and b"done" not in body


def test_this_machine_may_call_it_localhost(live):
    assert ask(live, "/state", host=f"localhost:{live.port}")[0].status == 200


def test_it_lets_nobody_else_read_or_frame_it(live):
    answer, _ = ask(live, "/", Origin="http://evil.example")
    assert answer.getheader("Access-Control-Allow-Origin") is None
    assert "frame-ancestors 'self'" in answer.getheader("Content-Security-Policy")
    assert answer.getheader("Cache-Control") == "no-store"


def test_the_state_is_what_was_said(live):
    line = ws.LiveLine("best", "#c8452d", [math.nan, 0.5])
    live.show(done=0.25, words="1 of 4", facts=[("best", "0.5")], curve="speed", unit="m/s",
              x=[1, 2], lines=[line])  # fmt: skip
    state = json.loads(ask(live, "/state")[1])
    assert state["done"] == 0.25 and state["facts"] == [["best", "0.5"]] and state["page"] == 0
    assert state["curve"]["lines"][0]["values"] == [None, 0.5]
    assert ask(live, "/robots")[0].status == 404, "there are none yet"
    live.show_robots("<p>1</p>")
    live.show_robots("<p>2</p>")
    assert json.loads(ask(live, "/state")[1])["page"] == 2
    assert ask(live, "/robots?2")[1] == b"<p>2</p>"
    live.show(done=0.5)
    assert json.loads(ask(live, "/state")[1])["page"] == 2


def test_it_ends_with_the_block():
    with ws.LiveServer("run") as live:
        port = live.port
    with pytest.raises(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
        pass


def test_a_port_that_is_taken_is_named(live):
    with pytest.raises(OSError, match=f"127.0.0.1 port {live.port}"):
        ws.LiveServer("another", port=live.port)


def test_somebody_who_hangs_up_harms_nobody(live):
    for data in (b"", b"GET", b"\x00\xff\r\n\r\n", b"GET / HTTP/1.1\r\nHost: " + b"a" * 70_000):
        with socket.create_connection(("127.0.0.1", live.port), timeout=5) as connection:
            connection.sendall(data)
    assert ask(live, "/state")[0].status == 200


def test_a_browser_shows_the_curve_and_the_robots_as_they_come(live, cube):
    result = ws.Simulation([cube.moved((0, 0, 0.1))], ws.Scene()).run(0.3, fps=20, energy=True)
    with Browser() as browser:
        page = browser.open(live.url, size=(1000, 700))
        assert page.evaluate("document.title") == "A <run>"
        assert not page.evaluate("document.getElementById('waiting').hidden")
        line = ws.LiveLine("best so far", "#c8452d", [0.1, 0.4, 0.8])
        live.show(
            done=0.75, words="3 of 4", curve="speed", unit="m/s", x=[10, 20, 30], lines=[line]
        )
        live.show_robots(ws.html_page(result, title="a cube"))
        page.wait("document.getElementById('waiting').hidden")
        page.wait("document.getElementById('state').textContent === '3 of 4'")
        assert page.evaluate("document.getElementById('done').value") == 0.75
        for _ in range(100):
            picture = page.picture()
            red, green, blue = (picture[..., k].astype(int) for k in range(3))
            curve = (abs(red - 0xC8) < 30) & (abs(green - 0x45) < 30) & (abs(blue - 0x2D) < 30)
            skin = (blue - red > 60)[300:]
            if curve.sum() > 50 and skin.sum() > 300:
                break
        else:
            pytest.fail(f"curve {curve.sum()} and robot {skin.sum()} pixels")
        assert page.complaints == []
        live.close()
        page.wait("document.getElementById('state').className === 'lost'")
        live.close = lambda: None
