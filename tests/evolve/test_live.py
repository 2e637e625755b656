"""A real run with --live, and real requests while it goes on."""

from __future__ import annotations

import json
import subprocess
import time
import urllib.error
import urllib.request

import pytest

from evolve.run import Run
from evolve.toml import load
from tests.evolve.conftest import TINY, command, environment, flags

LONGER = TINY | {"generations": 40}


def test_a_run_is_seen_while_it_goes_on_and_no_longer(tmp_path):
    arguments = ["run", "cube", "--live", "--csv", "--out", "live", *flags(LONGER)]
    process = subprocess.Popen(
        command(*arguments), cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, text=True
    )
    for text in process.stdout:
        if "http://" in text:
            url = text.split()[-1]
            break
    states = []
    while process.poll() is None:
        try:
            with urllib.request.urlopen(f"{url}state", timeout=10) as answer:
                states.append(json.load(answer))
            if states[-1]["page"]:
                with urllib.request.urlopen(f"{url}robots", timeout=10) as answer:
                    robots = answer.read().decode()
        except (urllib.error.URLError, ConnectionError):
            break
        time.sleep(0.02)
    printed = process.stdout.read()
    assert process.wait(60) == 0, printed
    assert "live/record.csv" in printed and "live/run.sqlite" in printed
    assert url.startswith("http://127.0.0.1:")
    dones = [state["done"] for state in states]
    assert dones == sorted(dones) and len(set(dones)) > 2, "it was updated"
    with Run.open(tmp_path / "live").read() as store:
        best = store.best(1)[0]
        fitness = store.scores([best]).fitness[0]
        digest = store.digest()
    curve = states[-1]["curve"]
    assert curve["unit"] == "body diameters per cycle" and curve["x"][0] == 24
    assert max(curve["lines"][0]["values"]) <= fitness
    assert "webgl2" in robots and "of live" in robots
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(f"{url}state", timeout=2)
    alone = Run.create(load("cube", LONGER), tmp_path / "alone")
    alone.evolve()
    with alone.read() as store:
        assert store.digest() == digest, "looking changes nothing"


def test_a_bad_address_is_one_clear_line(shell, tmp_path):
    done = shell("run", "cube", "--live", "--live-at", "here", *flags())
    assert done.returncode == 1
    assert done.stderr == (
        "evolve: 'here' is no place to serve: expected ADDRESS:PORT, as in 127.0.0.1:8000\n"
    )
    assert not (tmp_path / "runs").exists()
    done = shell("run", "cube", "--live", "--live-at", "192.0.2.1:0", "--out", "b", *flags())
    assert done.returncode == 1 and "cannot serve on 192.0.2.1 port 0" in done.stderr
