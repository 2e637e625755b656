"""Lesser processors: narrower registers, no estimate of an inverse square root, one lane."""

import json
import platform
import subprocess
import sys

import numpy as np
import pytest

import warp_springs as ws

# Flags for the compiler, and bytes of a register, of processors that this one can stand in for.
PROCESSORS = {"one lane": ("-march=native", 1)}
if platform.machine().lower() in ("x86_64", "amd64"):
    PROCESSORS |= {"AVX2": ("-target-cpu x86-64-v3", 32), "SSE2": ("-target-cpu x86-64", 16)}

# Runs as a process of its own: the kernels of one processor must not meet those of another.
CHILD = """
import json, sys
import warp as wp
import warp_springs as ws
from warp_springs.kernels import dialect

flags, size, cache, precision = json.loads(sys.argv[1])
wp.config.kernel_cache_dir = cache
dialect.PROCESSOR_OPTIONS["cpu_compiler_flags"] = flags
for name, module in list(sys.modules.items()):
    if name.startswith("warp_springs.") and hasattr(module, "native_width"):
        module.native_width = lambda p: max(1, size // (8 if p == "float64" else 4))
sys.path.insert(0, {tests!r})
from test_processors import ends
print(json.dumps([x.tolist() for x in ends(precision)]))
"""


def ends(precision):
    """Where five cubes that share a topology and a lattice that shares it with nobody end up."""
    scene = ws.Scene(damping=0.5, drag=0.01)
    cube = ws.shapes.cube(stiffness=2000.0).rotated((1, 2, 3), 0.7).moved((0, 0, 0.08))
    lattice = ws.shapes.lattice(2, 1, 1, stiffness=1500.0).moved((0, 0, 0.001))
    phase = np.linspace(0.0, 6.0, lattice.n_springs)
    lattice = lattice.replace(amplitude=0.1 * lattice.rest_length, phase=phase, omega=10.0)
    cubes = [cube.moving((0.1 * i, 0.0, 0.0)) for i in range(5)]
    result = ws.Simulation([*cubes, lattice], scene, 5e-4, precision=precision).run(0.05)
    return [result.positions(i) for i in range(6)]


@pytest.mark.parametrize("processor", PROCESSORS)
def test_a_lesser_processor_gives_the_same_motion(processor, tmp_path):
    flags, size = PROCESSORS[processor]
    precision = "mixed" if processor == "AVX2" else "float64"
    argument = json.dumps([flags, size, str(tmp_path), precision])
    child = CHILD.replace("{tests!r}", repr(str(__file__).rpartition("/")[0]))
    done = subprocess.run(
        [sys.executable, "-c", child, argument], capture_output=True, text=True, check=True
    )
    there = json.loads(done.stdout.splitlines()[-1])
    for here, other in zip(ends(precision), there, strict=True):
        atol = 1e-12 if precision == "float64" else 2e-6
        np.testing.assert_allclose(other, here, atol=atol, rtol=0.0)
    # The kernels were made for that processor's registers.
    width = max(1, size // (8 if precision == "float64" else 4))
    made = {path.name.split(f"lanes_{precision}_")[1] for path in tmp_path.rglob("*lanes*.cpp")}
    assert {name.partition("_")[0] for name in made} == {str(width), "1"}
