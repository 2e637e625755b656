"""USD files opened in three.js, in a headless Chromium: a viewer that is not ours.

with Viewer() as viewer:
    page = viewer.open("robots.usdc")
    page.evaluate("show(0.5)")  # half a second into the animation
    page.picture()
"""

from __future__ import annotations

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from tests.chromium import Browser, Page

HERE = Path(__file__).parent / "three"
THREE = HERE / "node_modules" / "three"


class Viewer:
    """A browser and a server of three.js and of the files that it opens; a context manager."""

    def __init__(self) -> None:
        if not (THREE / "build" / "three.module.js").is_file():
            raise RuntimeError(
                f"these tests open files in three.js, which is not in {THREE}; install it with: "
                "npm ci --prefix tests/three"
            )
        self._files: dict[str, Path] = {}
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, self._files))
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        self._browser = Browser()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self._browser.__exit__()
        self._server.shutdown()
        self._server.server_close()

    def open(self, path: Path, camera: str = "Camera", size: tuple[int, int] = (640, 360)) -> Page:
        """A page that shows a USD file with one of its cameras, ready to be played."""
        name = f"{len(self._files)}-{path.name}"
        self._files[name] = path
        address = f"http://127.0.0.1:{self._server.server_port}/viewer.html?/usd/{quote(name)}"
        page = self._browser.open(f"{address}#{quote(camera)}", size)
        page.wait("document.title === 'ready'")
        return page


class _Handler(SimpleHTTPRequestHandler):
    """Hands out the viewer, three.js and the files to be shown, and nothing else."""

    extensions_map = SimpleHTTPRequestHandler.extensions_map | {".js": "text/javascript"}

    def __init__(self, files: dict[str, Path], *arguments) -> None:
        self._files = files
        super().__init__(*arguments)

    def translate_path(self, path: str) -> str:
        parts = Path(unquote(urlsplit(path).path)).parts[1:]
        if len(parts) == 2 and parts[0] == "usd":
            return str(self._files.get(parts[1], HERE / "absent"))
        if parts[:1] == ("three",) and ".." not in parts:
            return str(THREE.joinpath(*parts[1:]))
        return str(HERE / ("viewer.html" if parts == ("viewer.html",) else "absent"))

    def log_message(self, *_: object) -> None:
        """Nothing."""
