"""The stability benchmark runs, keeps its promises on a small scale, and writes what it says."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import warp_springs as ws

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "stability.py"


def run(*arguments):
    command = [sys.executable, SCRIPT, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stability")
    figure, report = folder / "stability.png", folder / "stability.json"
    sizes = ("--resolution", 7, "--soak", 220, "--rest", 2)
    return run(*sizes, "--figure", figure, "--json", report), figure, report


def test_every_promise_is_kept(outcome):
    process, _, _ = outcome
    assert "broken" not in process.stdout
    assert process.stderr == ""
    assert process.returncode == 0


def test_figure_is_a_picture(outcome):
    _, figure, _ = outcome
    assert figure.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert figure.stat().st_size > 30_000


def test_report_holds_maps_soak_and_rest(outcome):
    _, _, report = outcome
    found = json.loads(report.read_text())
    axes = {(part["axis"], part["integrator"]) for part in found["maps"]}
    assert len(axes) == 9
    for part in found["maps"]:
        shape = (len(part["steps_s"]), len(part["values"]))
        assert len(part["stable_dt_s"]) == shape[1]
        for name in ("error_m", "energy_gain", "status"):
            assert (len(part[name]), len(part[name][0])) == shape
    soak = found["soak"]
    assert soak["garbage_robots"] == 220
    assert soak["refused_by_the_constructor"] == 20  # one in eleven is malformed
    assert soak["healthy_robots_compared"] == 4 * 22
    assert set().union(*soak["statuses"].values()) <= set(ws.Status.__members__)
    assert all(row["stopped"] == 0 for row in found["rest"])


def test_parts_can_be_left_out():
    process = run("--resolution", 0, "--soak", 0, "--rest", 0)
    assert process.returncode == 0
    assert process.stdout == ""
    refused = run("--resolution", 0, "--figure", "x.png")
    assert refused.returncode == 2
    assert "--resolution" in refused.stderr
