"""Exports that are killed with signal 9 in the middle: the old file is whole, nothing is left."""

import signal
import subprocess
import sys
import time
from contextlib import nullcontext, suppress

import pytest

import warp_springs as ws
from warp_springs.io.outputs import written_beside

EXPORTS = {
    "robots.usdc": "ws.export_usd(result, path)",
    "robots.html": "ws.export_html(result, path)",
    "robots.mp4": "ws.render(result, path, size=(640, 360))",
    "robots.webp": "ws.render(result, path, size=(640, 360))",
}
CHILD = """
import sys
import warp_springs as ws
ws.quiet()
result, path = ws.Result.load(sys.argv[1]), sys.argv[2]
print("ready", flush=True)
while True:
    {export}
"""
OLD = b"what was there before"


@pytest.fixture(scope="module")
def motion(walker, tmp_path_factory):
    """A result of many frames, in a file."""
    result = ws.Simulation([walker.moved((0, 0, 0.01 * i)) for i in range(4)]).run(4.0, fps=60)
    return result.save(tmp_path_factory.mktemp("killed") / "run.npz")


def drafts(folder):
    """What is being written."""
    with suppress(FileNotFoundError):  # it was finished just now
        return [path for some in folder.glob(".draft-*") for path in some.iterdir()]
    return []


def killed_in_the_middle(command, folder):
    """Run a process until something of a draft is on the disk, and kill it."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert process.stdout.readline() == b"ready\n"
        until = time.monotonic() + 30.0
        while not drafts(folder):
            assert process.poll() is None and time.monotonic() < until
            process.send_signal(signal.SIGSTOP if drafts(folder) else signal.SIGCONT)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert process.returncode == -signal.SIGKILL


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_that_is_killed(name, motion, tmp_path):
    path = tmp_path / name
    path.write_bytes(OLD)
    script = CHILD.format(export=EXPORTS[name])
    killed_in_the_middle([sys.executable, "-c", script, motion, path], tmp_path)
    assert list(tmp_path.glob(".draft-*"))  # it was in the middle
    if name != "robots.html":  # a page is written in a moment, perhaps for the second time
        assert path.read_bytes() == OLD
    before = path.read_bytes()
    result = ws.Result.load(motion)
    short = {"size": (64, 36), "duration": 0.1} if name.endswith(("mp4", "webp")) else {}
    export = {"usdc": ws.export_usd, "html": ws.export_html}.get(path.suffix[1:], ws.render)
    with pytest.warns(UserWarning, match="cycles") if short else nullcontext():
        export(result, path, **short)
    whole = path.read_bytes()
    assert before in (OLD, whole)
    assert [item.name for item in tmp_path.iterdir()] == [name]


def test_the_draft_of_somebody_who_lives_is_no_litter(tmp_path):
    with written_beside(tmp_path / "one.txt") as one:
        one.write_text("half")
        with written_beside(tmp_path / "two.txt") as two:
            two.write_text("two")
        assert one.read_text() == "half"
        one.write_text("whole")
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {
        "one.txt": "whole",
        "two.txt": "two",
    }
