"""A page about a run that is going on, served to this machine alone while it lasts."""

from __future__ import annotations

import ipaddress
import json
import math
import socket
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from warp_springs.view.pages.shell import filled

__all__ = ["LiveLine", "LiveServer"]

SCRIPTS = ("page_camera.js", "page_plot.js", "live.js")
LOOPBACK = "127.0.0.1"
_LOADS = "img-src data:; connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'"
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    f"frame-ancestors 'self'; {_LOADS}"
)


@dataclass(frozen=True)
class LiveLine:
    """A curve: its name, its colour as a screen takes it, and a value for every x."""

    name: str
    color: str
    values: Sequence[float]


@dataclass
class _Content:
    """What is served; the handler threads read it while the run replaces it."""

    state: bytes = b""
    robots: bytes = b""
    version: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock)


class LiveServer:
    """Serves a page with the progress, a curve and the robots of a run; a context manager.

    Three addresses are answered: ``/``, ``/state`` and ``/robots``; no file is read, whatever is
    asked for. It listens on the loopback address unless told otherwise, and answers only requests
    whose ``Host`` is the one that it listens on, so that no web page elsewhere can read it by a
    name of its own. It ends with the block, and the run goes on if nobody looks.

        with ws.LiveServer("walker") as live:
            print(live.url)
            live.show(done=0.5, words="generation 5 of 10", x=[1, 2], lines=[...])
            live.show_robots(ws.html_page(result))

    Args:
        title: What the page is called.
        address: Address to listen on.
        port: Port to listen on; 0 takes one that is free.

    Raises:
        OSError: The address or the port cannot be had; the message names them.
    """

    def __init__(self, title: str, address: str = LOOPBACK, port: int = 0) -> None:
        self._content = _Content()
        shell = filled("live", title=title, policy=_LOADS, scripts=SCRIPTS)
        self.show()
        handler = type("Handler", (_Handler,), {"shell": shell.encode(), "content": self._content})
        kind = _Server6 if ":" in address else _Server
        try:
            self._server = kind((address, port), handler)
        except (OSError, OverflowError) as error:
            raise OSError(f"cannot serve on {address} port {port}: {error}") from error
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def port(self) -> int:
        """The port that it listens on."""
        return self._server.server_address[1]

    @property
    def url(self) -> str:
        """Where to look."""
        host = self._server.server_address[0]
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"

    def show(
        self,
        *,
        done: float = 0.0,
        words: str = "",
        facts: Sequence[tuple[str, str]] = (),
        curve: str = "",
        unit: str = "",
        x: Sequence[float] = (),
        x_name: str = "",
        lines: Sequence[LiveLine] = (),
    ) -> None:
        """Say how far the run is.

        Args:
            done: Share of the run that is done, 0 to 1.
            words: How far it is.
            facts: Figures: (name, words).
            curve: What the curves show.
            unit: Of their values.
            x: Where their values are, ascending; n of them.
            x_name: What these are, with their unit.
            lines: Curves of n values; what is not finite is a gap.
        """
        state = {
            "done": done,
            "words": words,
            "facts": [[name, text] for name, text in facts],
            "curve": {
                "title": curve,
                "unit": unit,
                "xName": x_name,
                "x": [float(v) for v in x],
                "lines": [
                    {"name": e.name, "color": e.color, "values": [_number(v) for v in e.values]}
                    for e in lines
                ],
            },
        }
        with self._content.lock:
            self._content.state = _packed(state | {"page": self._content.version})

    def show_robots(self, page: str) -> None:
        """Show another page, as `ws.html_page` returns it, in place of the one before."""
        with self._content.lock:
            self._content.robots = page.encode()
            self._content.version += 1
            state = json.loads(self._content.state)
            self._content.state = _packed(state | {"page": self._content.version})

    @staticmethod
    def place(text: str) -> tuple[str, int]:
        """Read ADDRESS:PORT, for the arguments of a server.

        Raises:
            ValueError: It is something else.
        """
        address, _, port = text.rpartition(":")
        if not address or not port.isdecimal():
            raise ValueError(f"{text!r} is no place to serve: expected ADDRESS:PORT, as in "
                             "127.0.0.1:8000")  # fmt: skip
        return address.strip("[]"), int(port)

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def __enter__(self) -> LiveServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Somebody who hangs up in the middle of an answer is no event for the run's screen."""


class _Server6(_Server):
    address_family = socket.AF_INET6


class _Handler(BaseHTTPRequestHandler):
    """Answers three addresses, and nothing else."""

    shell: bytes
    content: _Content
    timeout = 10.0

    def do_GET(self) -> None:
        """Answer with a body."""
        self._answer(body=True)

    def do_HEAD(self) -> None:
        """Answer without one."""
        self._answer(body=False)

    def version_string(self) -> str:
        """What serves; versions are nobody's business."""
        return "warp-springs"

    def log_message(self, *_: Any) -> None:
        """The screen belongs to the run."""

    def _answer(self, body: bool) -> None:
        if not self._is_meant():
            return self._send(HTTPStatus.FORBIDDEN, "text/plain", b"wrong host\n", body)
        path = self.path.partition("?")[0]
        with self.content.lock:
            known = {
                "/": ("text/html; charset=utf-8", self.shell),
                "/state": ("application/json", self.content.state),
                "/robots": ("text/html; charset=utf-8", self.content.robots),
            }
        kind, data = known.get(path, ("", b""))
        if not data:
            return self._send(HTTPStatus.NOT_FOUND, "text/plain", b"nothing here\n", body)
        return self._send(HTTPStatus.OK, kind, data, body)

    def _is_meant(self) -> bool:
        """Whether the request names this server as its host, not some name that points to it."""
        name, _, port = self.headers.get("Host", "").rpartition(":")
        address, own_port = self.server.server_address[:2]
        if port != str(own_port):
            return False
        name = name.strip("[]").lower()
        if ipaddress.ip_address(address).is_loopback:
            return name in (address, "localhost")
        return _is_literal(name) or name == socket.gethostname().lower()

    def _send(self, status: HTTPStatus, kind: str, data: bytes, body: bool) -> None:
        self.send_response(status)
        headers: Mapping[str, str] = {
            "Content-Type": kind,
            "Content-Length": str(len(data)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": _POLICY,
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        }
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if body:
            self.wfile.write(data)


def _is_literal(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _packed(state: Mapping[str, Any]) -> bytes:
    return json.dumps(state, allow_nan=False).encode()
