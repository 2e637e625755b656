"""The CUDA kernels, compiled ahead of time and taken apart: no GPU is needed for that."""

from dataclasses import replace

import cuda_static
import pytest
import warp as wp

from warp_springs.engine.layouts import BLOCK_SIZES
from warp_springs.kernels.control import control
from warp_springs.kernels.traits import Traits

CASES = [
    ("block", "float32", "walking", "leapfrog", True),
    ("block", "mixed", "walking", "chin4", False),
    ("block", "float64", "walking", "chin4", True),
    ("flat", "mixed", "walking", "chin4", True),
]


@pytest.mark.parametrize("arch", [80, 90, 100])
@pytest.mark.parametrize("case", CASES, ids=lambda case: "-".join(map(str, case)))
def test_kernels_compile_without_spills(case, arch, tmp_path):
    layout, precision, scene, integrator, ledger = case
    about = cuda_static.features(layout, precision, scene, integrator, ledger)
    # The largest blocks have the fewest registers for a thread.
    path = cuda_static.compiled(about, arch, BLOCK_SIZES[precision][-1], tmp_path)
    used = cuda_static.resources(path)
    assert {name: row["spilled"] for name, row in used.items() if row["spilled"]} == {}
    expected = {"advance"} if layout == "block" else {"kick", "find", "settle", "wind", "tick"}
    assert expected <= used.keys()


SPECIAL = Traits(
    outer=True,
    skin=True,
    bound=True,
    harmonics=2,
    own_omegas=True,
    curved=True,
    hinges=1,
    dashpots=True,
    limits=True,
    timetable=True,
)


@pytest.mark.parametrize(
    ("layout", "precision", "size", "bytes_spilled"),
    [
        ("block", "float32", 256, 0),
        ("block", "float64", 256, 0),
        ("block", "mixed", 384, 80),  # the largest, with fewer registers for a thread
        ("flat", "mixed", 256, 0),
    ],
)
def test_all_elements_at_once_spill_nothing_that_a_spring_needs(
    layout, precision, size, bytes_spilled, tmp_path
):
    about = replace(cuda_static.features(layout, precision, "walking", ledger=True), traits=SPECIAL)
    path = cuda_static.compiled(about, 90, size, tmp_path)
    used, code = cuda_static.resources(path), cuda_static.instructions(path)
    steps = {"advance"} if layout == "block" else {"kick_rates", "last_kick_middle", "find"}
    assert steps <= used.keys()
    assert max(row["spilled"] for row in used.values()) <= bytes_spilled
    loops = [loop for kernel in code.values() for loop in cuda_static.inner_loops(kernel)]
    assert any(op.startswith("MUFU.RSQ") for loop in loops for op in loop)
    assert not any(op.startswith(("LDL", "STL")) for loop in loops for op in loop)


@pytest.mark.parametrize("layout", ["block", "flat"])
def test_the_loop_over_springs_is_what_it_should_be(layout, tmp_path):
    about = cuda_static.features(layout, "float32", "walking")
    code = cuda_static.instructions(cuda_static.compiled(about, 90, 256, tmp_path))
    loop = cuda_static.spring_loop(code["advance" if layout == "block" else "kick"])
    assert loop.widest == 16
    assert loop.bytes == 4 + 16 + 16  # the neighbour's number, four coefficients, its position
    assert loop.doubles == 0
    assert 15 < loop.instructions < 30
    assert not any(op.startswith(("LDL", "STL")) for op, _ in code[next(iter(code))])


def test_limits_follow_from_the_loop():
    chip = cuda_static.CHIPS["H100"]
    loop = cuda_static.Loop(instructions=64.0, doubles=0.0, roots=1.0, bytes=4.0, widest=16)
    assert loop.springs_per_second(chip) == pytest.approx(chip.cores * chip.clock)
    starved = cuda_static.Loop(instructions=64.0, doubles=0.0, roots=1.0, bytes=128.0, widest=16)
    assert starved.springs_per_second(chip) == pytest.approx(0.5 * chip.cores * chip.clock)
    doubles = cuda_static.Loop(instructions=64.0, doubles=64.0, roots=1.0, bytes=4.0, widest=16)
    assert doubles.springs_per_second(chip) == pytest.approx(0.5 * chip.cores * chip.clock)


def test_the_table_has_a_line_for_every_row(tmp_path):
    row = cuda_static.measure("A100", "block", "float32", "springs", tmp_path)
    lines = cuda_static.table([row, row]).splitlines()
    assert len(lines) == 3
    assert f"{row['instructions_per_spring']:.1f}" in lines[1]
    assert row["memory_limit"] == pytest.approx(2.039e12 / 24)


@pytest.mark.parametrize(("precision", "obstacles"), [("float32", 2), ("mixed", 0)])
def test_controllers_compile(precision, obstacles, tmp_path):
    module = control(precision, not obstacles, obstacles).module
    (path,) = wp.compile_aot_module(module, arch=[90], module_dir=tmp_path, use_ptx=False)
    assert "set_muscles" in cuda_static.resources(path)
