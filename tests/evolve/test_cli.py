from __future__ import annotations

import os
import pty
import re
import shutil
import signal
import sqlite3
import subprocess
import time

import pytest
from PIL import Image
from rich.console import Console

from evolve.run import Run
from evolve.toml import preset_names
from tests.evolve.conftest import TINY, command, environment, flags, shell_in


def words(text: str) -> str:
    return " ".join(text.split())


def test_help_is_fast_and_names_every_command(shell):
    seconds = []
    for _ in range(3):  # the first start may have to compile bytecode, others may be disturbed
        started = time.perf_counter()
        done = shell("--help")
        seconds.append(time.perf_counter() - started)
        assert done.returncode == 0
    assert min(seconds) < 1.5
    for name in ("presets", "run", "resume", "report", "export", "lineage", "digest"):
        assert name in done.stdout
        detail = shell(name, "--help")
        assert detail.returncode == 0 and len(detail.stdout) > 200


def test_presets_are_listed_one_a_line(shell):
    done = shell("presets")
    lines = done.stdout.splitlines()
    assert [line.split()[0] for line in lines] == preset_names()
    assert all(re.search(r"  (fixed|evolving) body  +\w", line) for line in lines)


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """What a run said, and the folder in which it left runs/cube."""
    place = tmp_path_factory.mktemp("example")
    done = shell_in(place)("run", "cube", "--seed", 5, "--threads", 1, *flags())
    assert done.returncode == 0, done.stderr
    return done, place


@pytest.fixture
def run_folder(example, tmp_path):
    """A copy of that run, in the folder in which `shell` runs."""
    return shutil.copytree(example[1] / "runs/cube", tmp_path / "runs/cube")


def test_a_run_says_what_it_does_and_what_it_wrote(example):
    done, place = example
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert lines[0].startswith("cube  ") and "seed 5" in done.stdout
    assert sum(line.startswith("generation ") for line in lines) == 4
    assert "96 evaluations" in done.stdout and "springs/s" in done.stdout
    verdict = r"champion #\d+ of generation \d: [\d.]+ body diameters per cycle; "
    verdict += (
        r"[\d.]+ \(\d+%\) at half the time step, [\d.]+ \(\d+%\) from perturbed starts: survives"
    )
    assert re.search(verdict, done.stdout)
    written = [line.strip() for line in lines[lines.index("wrote") + 1 :]]
    names = ["run.sqlite", "champion.usdc", "zoo.usdc", "zoo.png"]
    names += ["learning_curve.png", "dot_plot.png"]
    assert written == [f"runs/cube/{name}" for name in names]
    assert all((place / path).stat().st_size > 0 for path in written)
    assert "\x1b" not in done.stdout, "no colours where nobody sees them"


def test_a_run_is_repeated_from_its_toml_and_made_longer(shell, run_folder):
    first = shell("digest", "runs/cube")
    assert re.fullmatch(r"[0-9a-f]{64}\n", first.stdout)
    again = shell("run", "runs/cube/run.toml", "--out", "again", "--threads", 2)
    assert again.returncode == 0, again.stderr
    assert shell("digest", "again").stdout == first.stdout
    longer = shell("resume", "again", "--generations", 5)
    assert "generation 5/5" in longer.stdout
    assert shell("digest", "again").stdout != first.stdout


def test_a_run_is_never_overwritten(shell, run_folder):
    refused = shell("run", "cube", *flags())
    assert refused.returncode == 1
    assert refused.stderr == (
        "evolve: runs/cube already holds a run; continue it with evolve resume runs/cube, "
        "or choose another place with --out\n"
    )


def test_a_report_draws_and_tells(shell, run_folder):
    (run_folder / "dot_plot.png").unlink()
    report = shell("report", "runs/cube", "--plots-only")
    assert report.returncode == 0, report.stderr
    for subject in ("body", "search", "evaluations", "verdict", "second look", "digest"):
        assert f"\n{subject}" in f"\n{report.stdout}"
    assert report.stdout.endswith("runs/cube/dot_plot.png\n")
    assert (run_folder / "dot_plot.png").exists()


def test_an_export_shows_the_best_in_one_world(shell, run_folder):
    (run_folder / "zoo.usdc").unlink()
    export = shell("export", "runs/cube", "--best", 4)
    assert export.returncode == 0, export.stderr
    assert "champion #" in export.stdout and export.stdout.endswith("zoo.png\n")

    from pxr import Usd

    stage = Usd.Stage.Open(str(run_folder / "zoo.usdc"))
    custom = [prim.GetCustomData() for prim in stage.Traverse()]
    custom = [data for data in custom if "individual" in data]
    assert len(custom) == len({data["individual"] for data in custom}) == 4
    ranks = [(data["survivesSecondLook"], data["fitness"]) for data in custom]
    assert ranks == sorted(ranks, reverse=True)
    for name in ("AtHalfStep", "Perturbed"):
        share = custom[0][f"fitness{name}"] / custom[0]["fitness"]
        assert custom[0][f"kept{name}"] == pytest.approx(share) and share >= 0.8
    assert all(data["seed"] == 5 and data["run"] == "cube" for data in custom)


def test_an_export_films_champion_and_zoo(run_folder, monkeypatch, capsys):
    import functools

    import warp_springs as ws
    from evolve.commands.export import Export

    monkeypatch.setattr(ws, "render", functools.partial(ws.render, size=(96, 54)), raising=False)
    assert Export(run_folder, best=2, film="webp")(Console()) == 0
    written = [line.rpartition("/")[2] for line in capsys.readouterr().out.splitlines()]
    assert written[-3:] == ["zoo.png", "champion.webp", "zoo.webp"]
    period = Run.open(run_folder).config.encoding.period
    for name in ("champion", "zoo"):
        with Image.open(run_folder / f"{name}.webp") as film:
            assert film.n_frames >= 3 * period * 30 and film.size == (96, 54)


def custom_data(path):
    """What the robots of a file say of themselves, by their names."""
    from pxr import Usd

    stage = Usd.Stage.Open(str(path))
    robots = stage.GetPrimAtPath("/World/Robots").GetChildren()
    return {robot.GetName(): robot.GetCustomData() for robot in robots}


def test_an_export_shows_a_whole_generation(shell, run_folder):
    export = shell("export", "runs/cube", "--generation", -1, "--format", "usda")
    assert export.returncode == 0, export.stderr
    path = run_folder / "generation_0003.usda"
    assert export.stdout == f"24 robots\nwrote\n  runs/cube/{path.name}\n"
    told = custom_data(path)
    assert len(told) == 24
    assert all(data["generation"] == 3 for data in told.values())
    assert all(name == f"robot_{data['individual']}" for name, data in told.items())
    assert all(1 <= len(data["parents"]) <= 2 for data in told.values())
    fitness = [data["fitness"] for data in told.values() if "fitness" in data]
    assert len(fitness) > 12 and fitness == sorted(fitness, reverse=True)


def test_an_export_shows_chosen_robots(shell, run_folder):
    export = shell("export", "runs/cube", "--robots", 7, 3, "--color", "material")
    assert export.returncode == 0, export.stderr
    told = custom_data(run_folder / "robots.usdc")
    assert list(told) == ["robot_7", "robot_3"]
    assert all("parents" not in data for data in told.values())  # they were the first
    assert not (run_folder / "robots.usdc").read_bytes().startswith(b"#usda")


def test_a_run_in_which_nobody_survives_says_so(shell, run_folder):
    path = run_folder / "run.toml"
    path.write_text(path.read_text().replace("threshold = 0.8", "threshold = 9.0"))
    export = shell("export", "runs/cube")
    assert export.returncode == 0, export.stderr
    none = re.match(
        r"no champion: none of (\d+) good ones survives the second look; ", export.stdout
    )
    assert none and int(none[1]) > 32
    assert "champion.usdc" not in export.stdout and not (run_folder / "champion.usdc").exists()
    assert (run_folder / "zoo.usdc").exists()
    assert f"0 of {none[1]} survive" in words(shell("report", "runs/cube", "--plots-only").stdout)


MISTAKES = [
    (["run", "cub"], "there is no preset 'cub' (did you mean 'cube'?); presets are "),
    (["run", "my.toml"], "there is no file my.toml"),
    (["run", "cube", "--population", 0], "preset cube: population: input should be greater than"),
    (
        ["run", "cube", "--optimizer", "magic"],
        "optimizer.type must be one of 'random'",
    ),
    (
        ["run", "cube", "--set", "task.mesure=2"],
        "unknown key task.mesure (did you mean",
    ),
    (["run", "cube", "--set", "x"], "--set takes KEY=VALUE"),
    (["run", "cube", "--set", "simulation.device=tpu"], "device: got 'tpu', expected one of"),
    (["run", "cube", "--devices", "cpu:7"], "device: got 'cpu:7', expected one of"),
    (["run", "cube", "--optimizer", "coevolution"], "coevolution: needs two populations"),
    (["run", "cube", "--live-at", "127.0.0.1:80"], "--live-at 127.0.0.1:80 goes with --live"),
    (["run", "cube", "--cluster", "auto"], "as in --devices cpu cpu"),
    (["report", ".", "--notes", "none.txt"], "--notes: there is no file none.txt"),
    (["resume", "nowhere"], "there is no folder nowhere"),
    (["report", "nowhere"], "there is no folder nowhere"),
    (["export", "nowhere"], "there is no folder nowhere"),
    (["digest", "nowhere"], "there is no folder nowhere"),
    (["export", ".", "--best", 0], "--best must be 1 to 100, not 0"),
    (["export", ".", "--generation", 0, "--robots", 1], "--robots and --generation are two"),
    (["digest", "."], ". holds no run (it has no run.toml)"),
]


@pytest.mark.parametrize(("arguments", "message"), MISTAKES, ids=lambda x: words(str(x))[:50])
def test_a_mistake_costs_one_clear_line(shell, arguments, message):
    done = shell(*arguments)
    assert done.returncode == 1
    assert done.stderr.startswith("evolve: ") and message in done.stderr
    assert done.stderr.count("\n") == 1
    assert shell("resume", "runs/cube").stderr == "evolve: there is no folder runs/cube\n"


def test_a_command_line_without_sense_is_explained(shell):
    for arguments in (["bogus"], ["run", "cube", "--sed", "3"], ["resume"], ["run", "--seed", "x"]):
        done = shell(*arguments)
        assert done.returncode == 2
        assert "Traceback" not in done.stderr and "--help" in done.stderr + done.stdout


def test_a_broken_record_is_one_clear_line(shell, run_folder):
    (run_folder / "run.sqlite").write_bytes(b"rubbish" * 1000)
    for name in ("resume", "report", "export", "lineage", "digest"):
        done = shell(name, "runs/cube")
        assert done.returncode == 1
        assert done.stderr == (
            "evolve: runs/cube/run.sqlite cannot be read: file is not a database\n"
        )


def test_a_record_where_nobody_may_write_is_still_read(run_folder, monkeypatch):
    # As on a medium that is read-only: SQLite cannot make the files of its log there.
    run = Run.open(run_folder)
    with run.read() as store:
        digest = store.digest()
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    opened = []
    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda *a, **k: opened.append(a) or connect(*a, **k))
    with run.read() as store:
        assert store.digest() == digest
    assert opened[-1][0].endswith("?mode=ro&immutable=1")


def test_a_run_of_an_older_version_is_one_clear_line(shell, run_folder):
    with sqlite3.connect(run_folder / "run.sqlite") as connection:
        connection.execute("PRAGMA user_version = 1")
    path = run_folder / "run.toml"
    path.write_text("[task]\nsecond_look = 0.8\n")
    for name in ("resume", "report", "export", "lineage", "digest"):
        done = shell(name, "runs/cube")
        assert done.returncode == 1 and done.stderr.count("\n") == 1
        assert "was written by an older version of evolve (format 1" in done.stderr


def test_ctrl_c_ends_at_a_generation_and_says_how_to_go_on(tmp_path):
    arguments = command("run", "cube", *flags(TINY | {"generations": 100_000}))
    process = subprocess.Popen(
        arguments,
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 60.0
    record = tmp_path / "runs/cube/run.sqlite-wal"
    while not (record.exists() and record.stat().st_size > 200_000):
        assert time.monotonic() < until and process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors == ""
    assert output.endswith("stopped; continue with: evolve resume runs/cube\n")


def test_a_terminal_sees_a_live_display(tmp_path):
    leader, follower = pty.openpty()
    process = subprocess.Popen(
        command("run", "cube", *flags()),
        cwd=tmp_path,
        env=environment() | {"TERM": "xterm-256color"},
        stdin=follower,
        stdout=follower,
        stderr=follower,
    )
    os.close(follower)
    output = b""
    while True:
        try:
            piece = os.read(leader, 65536)
        except OSError:  # the other end is closed
            break
        if not piece:
            break
        output += piece
    os.close(leader)
    assert process.wait(timeout=60) == 0
    text = output.decode()
    assert "\x1b[" in text, "colours and a display that moves"
    seen = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text)
    for piece in ("4/4 generations", "96 evaluations", "champion #", "wrote"):
        assert piece in seen


def test_several_seeds_at_once_are_what_they_are_alone(shell, run_folder):
    done = shell("run", "cube", "--seed", 4, "--seeds", 2, "--out", "many", *flags())
    assert done.returncode == 0, done.stderr
    assert "seeds   4, 5" in done.stdout and "192 evaluations" in done.stdout
    assert len(re.findall("champion #", done.stdout)) == 2
    assert shell("digest", "many/seed-5").stdout == shell("digest", "runs/cube").stdout
    longer = shell("resume", "many", "--generations", 5)
    assert "generation 5/5" in longer.stdout and "240 evaluations" in longer.stdout
    refused = shell("run", "cube", "--seeds", 2, "--out", "many", *flags())
    assert refused.returncode == 1 and "many is not empty" in refused.stderr
    refused = shell("run", "cube", "--seeds", 0, *flags())
    assert refused.stderr == "evolve: --seeds must be 1 or more, not 0\n"


def test_another_encoding_is_one_word_and_devices_are_workers(shell):
    done = shell(
        "run", "cube", "--encoding", "fourier", "--devices", "cpu", "cpu", *flags(),
        "encoding.waves=1",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "genetic over fourier genomes" in done.stdout
    alone = shell(
        "run", "cube", "--encoding", "fourier", "--out", "alone", *flags(), "encoding.waves=1"
    )
    assert alone.returncode == 0, alone.stderr
    assert shell("digest", "alone").stdout == shell("digest", "runs/cube").stdout
    wrong = shell("run", "cube", "--encoding", "fourrier")
    assert wrong.returncode == 1 and "encoding.type must be one of" in wrong.stderr
