"""What the CUDA kernels can do at most, read from their machine code; no GPU needed.

    python benchmarks/cuda_static.py [--json FILE]

Compiles the block and the flat layout for an A100 (sm_80), an H100 (sm_90) and an RTX 4090 (sm_89),
takes the machine code apart (packages nvidia-cuda-cuobjdump and nvidia-cuda-nvdisasm, in the extra
``cuda-static``) and prints for each kernel registers, spilled bytes, shared memory and the threads
that are resident on a multiprocessor; for its loop over springs the instructions per spring, and
three limits in springs per second.

How the limits come about. A mass gathers all of its springs, so each spring is computed from both
of its ends. The innermost loop that holds an inverse square root and a load of 16 bytes or more is
the loop over the ends of a mass; it is unrolled, and as often as the root stands in it, so many
ends it computes a turn. Divided by that, its instructions I, its operations in double precision D,
its roots R (one) and its bytes B from shared memory and the first-level cache are per end. A
multiprocessor issues 128 instructions (4 warps of 32) a clock, has 16 lanes for roots, the lanes
for doubles that the table below says, and moves 128 bytes a clock out of shared memory and cache
together. So per clock it computes at most

    min(128 / I, lanes / D, 16 / R, 128 / B) / 2   springs,

times multiprocessors times clock: the limit of the *chip*, while the coefficients of the robots in
flight stay in the first-level cache. Moving the masses, barriers and waiting are not in it. If the
coefficients come from memory instead, each end loads its neighbour's number (4 bytes) and two or
four coefficients every pass, and the limit is that of *memory*: bandwidth / (2 x those bytes);
between the two lies a population whose coefficients fit the second-level cache: *fits* says how
many springs that is. These are upper limits, not measurements.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import re
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import warp as wp

from warp_springs.engine.layouts import BLOCK_SIZES
from warp_springs.kernels.block import block
from warp_springs.kernels.buffers import real_dtype
from warp_springs.kernels.flat_launches import launches
from warp_springs.kernels.gather import SLICE, GatherFeatures


@dataclass(frozen=True)
class Chip:
    """Published figures of a GPU.

    Attributes:
        arch: Compute capability, 80 for 8.0.
        cores: Multiprocessors.
        clock: Boost clock [Hz].
        doubles: Multiply-adds in double precision a clock and multiprocessor.
        memory: Bandwidth of the memory [B/s].
        cache: Second-level cache [B].
        threads: Resident threads of a multiprocessor at most.
        shared: Shared memory of a multiprocessor [B].
    """

    arch: int
    cores: int
    clock: float
    doubles: int
    memory: float
    cache: float
    threads: int
    shared: int


CHIPS = {
    "A100": Chip(80, 108, 1.41e9, 32, 2.039e12, 40e6, 2048, 164 * 1024),
    "H100": Chip(90, 132, 1.98e9, 64, 3.35e12, 50e6, 2048, 228 * 1024),
    "RTX 4090": Chip(89, 128, 2.52e9, 2, 1.008e12, 72e6, 1536, 100 * 1024),
}
REGISTERS = 65536
LANES, ROOTS, BYTES = 128, 16, 128  # a clock and multiprocessor
#: What is compiled in: all that a walking robot on the ground needs, and springs alone.
SCENES = {
    "walking": {
        "actuated": True,
        "ground": True,
        "friction": "coulomb",
        "damping": True,
        "drag": True,
    },
    "springs": {
        "actuated": False,
        "ground": False,
        "friction": "none",
        "damping": False,
        "drag": False,
    },
}


def features(layout: str, precision: str, scene: str, integrator: str = "chin4", ledger=False):
    """Features of a crowd on a GPU."""
    return GatherFeatures(
        precision=precision,
        width=SLICE,
        integrator=integrator,
        ledger=ledger,
        layout="launches" if layout == "flat" else layout,
        **SCENES[scene],
    )


def compiled(about: GatherFeatures, arch: int, size: int, folder: Path) -> Path:
    """Machine code of the kernels of a layout, compiled ahead of time."""
    kernel = block(about, size) if about.layout == "block" else launches(about).tick
    module = kernel.module
    wp.set_module_options({"block_dim": size}, module)
    (path,) = wp.compile_aot_module(module, arch=[arch], module_dir=folder, use_ptx=False)
    return Path(path)


def tool(name: str) -> str:
    """Path of one of NVIDIA's tools, as its package installs it."""
    package = f"nvidia-cuda-{name}"
    try:
        files = importlib.metadata.files(package) or []
    except importlib.metadata.PackageNotFoundError:
        sys.exit(f"{package} is not installed; try: pip install 'warp-springs[cuda-static]'")
    return str(next(f.locate() for f in files if f.name in (name, f"{name}.exe")))


def resources(path: Path) -> dict[str, dict[str, int]]:
    """Registers, spilled bytes and static shared memory of each kernel of a file."""
    text = _output(tool("cuobjdump"), "--dump-resource-usage", path)
    found = {}
    for name, rest in re.findall(r"Function (\w+):\s*\n\s*(.*)", text):
        numbers = dict(re.findall(r"(\w+):(\d+)", rest))
        found[_short(name)] = {
            "registers": int(numbers["REG"]),
            "spilled": int(numbers["STACK"]) + int(numbers["LOCAL"]),
            "shared": int(numbers["SHARED"]),
        }
    return found


def instructions(path: Path) -> dict[str, list[tuple[str, str]]]:
    """The disassembled instructions of each kernel: ("label", name) or (operation, operands)."""
    text = _output(tool("nvdisasm"), "-c", path)
    found: dict[str, list[tuple[str, str]]] = {}
    for line in text.splitlines():
        if section := re.match(r"\s*\.section\s+\.text\.(\w+)", line):
            found[_short(section[1])] = now = []
        elif label := re.match(r"(\.L_x_\d+):", line):
            now.append(("label", label[1]))
        elif code := re.match(r"\s*/\*[0-9a-f]+\*/\s+(?:@!?U?P\w+\s+)?([A-Z0-9_.]+)(.*);", line):
            now.append((code[1], code[2]))
    return found


def _output(*command) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def _short(name: str) -> str:
    """The kernel's own name, without Warp's decoration."""
    return re.sub(r"_[0-9a-f]{8}_cuda_kernel_forward$", "", name).split("__")[-1]


@dataclass(frozen=True)
class Loop:
    """The loop over springs; numbers are per end of a spring.

    Attributes:
        instructions: All of them.
        doubles: Operations in double precision.
        roots: Inverse square roots: one, in how many parts the processor takes them.
        bytes: Bytes loaded, from shared memory and from the first-level cache.
        widest: Bytes of its widest load from memory.
    """

    instructions: float
    doubles: float
    roots: float
    bytes: float
    widest: int

    def springs_per_second(self, chip: Chip) -> float:
        """The limit of the chip."""
        ends = min(
            LANES / self.instructions,
            chip.doubles / self.doubles if self.doubles else LANES,
            ROOTS / self.roots,
            BYTES / self.bytes,
        )
        return 0.5 * ends * chip.cores * chip.clock


def inner_loops(code: list[tuple[str, str]]) -> list[list[str]]:
    """The operations of each innermost loop of a kernel."""
    labels = {name: at for at, (kind, name) in enumerate(code) if kind == "label"}
    loops = []
    for at, (operation, operands) in enumerate(code):
        target = re.search(r"\.L_x_\d+", operands)
        if operation.startswith("BRA") and target and labels.get(target[0], at) < at:
            loops.append((labels[target[0]], at))
    inner = [a for a in loops if not any(a[0] <= b[0] and b[1] < a[1] for b in loops)]
    return [[op for op, _ in code[first : last + 1] if op != "label"] for first, last in inner]


def spring_loop(code: list[tuple[str, str]]) -> Loop | None:
    """The loop over springs of a kernel, or None if it has none."""
    best: tuple[int, Loop] | None = None
    for body in inner_loops(code):
        roots = sum(op.startswith("MUFU.RSQ") for op in body)
        widths = [_width(op) for op in body if op.startswith("LDG")]
        if roots == 0 or max(widths, default=0) < 16 or (best and roots <= best[0]):
            continue
        best = (
            roots,
            Loop(
                instructions=len(body) / roots,
                doubles=sum(bool(re.match(r"D(ADD|MUL|FMA|SETP|MNMX)", op)) for op in body) / roots,
                roots=1.0,
                bytes=sum(_width(op) for op in body if op.startswith(("LDG", "LDS"))) / roots,
                widest=max(widths),
            ),
        )
    return best and best[1]


def _width(operation: str) -> int:
    """Bytes that a load moves."""
    for bits in (256, 128, 64):
        if f".{bits}" in operation:
            return bits // 8
    return 4


def measure(name: str, layout: str, precision: str, scene: str, folder: Path) -> dict:
    """One row: a chip, a layout, a precision, a scene."""
    chip, size = CHIPS[name], BLOCK_SIZES[precision][0]
    about = features(layout, precision, scene)
    path = compiled(about, chip.arch, size, folder)
    used, code = resources(path), instructions(path)
    kernel = "advance" if layout == "block" else "kick"
    loop = spring_loop(code[kernel])
    itemsize = real_dtype(precision).itemsize
    shared = used[kernel]["shared"] + (8 * size * itemsize if layout == "block" else 0)
    blocks = min(
        REGISTERS // (-(-used[kernel]["registers"] // 8) * 8 * size),
        chip.shared // shared,
        chip.threads // size,
    )
    end = 4 + (4 if about.actuated else 2) * itemsize
    return {
        "chip": name,
        "layout": layout,
        "precision": precision,
        "scene": scene,
        "kernels": used,
        "registers": used[kernel]["registers"],
        "spilled": max(row["spilled"] for row in used.values()),
        "shared_bytes": shared,
        "threads": blocks * size,
        **{f"{key}_per_end": value for key, value in asdict(loop).items() if key != "widest"},
        "widest_load": loop.widest,
        "instructions_per_spring": 2.0 * loop.instructions,
        "chip_limit": loop.springs_per_second(chip),
        "memory_limit": chip.memory / (2 * end),
        "springs_in_cache": chip.cache / (2 * end),
    }


def table(rows: list[dict]) -> str:
    """The rows as text."""
    head = ("chip", "layout", "precision", "scene", "regs", "spills", "shared", "threads")
    head += ("instr/spring", "chip limit", "memory limit", "fits")
    lines = [head, *map(_cells, rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i < 4 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        for line in lines
    )


def _cells(row: dict) -> tuple[str, ...]:
    return (
        *(row[key] for key in ("chip", "layout", "precision", "scene")),
        str(row["registers"]),
        f"{row['spilled']} B",
        f"{row['shared_bytes'] / 1024:.1f} KiB",
        str(row["threads"]),
        f"{row['instructions_per_spring']:.1f}",
        f"{row['chip_limit'] / 1e9:.0f} G/s",
        f"{row['memory_limit'] / 1e9:.0f} G/s",
        f"{row['springs_in_cache'] / 1e6:.1f} M",
    )


def main() -> None:
    """Compile, take apart, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write all figures to this file as well")
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            measure(chip, layout, precision, scene, Path(folder))
            for chip in CHIPS
            for layout in ("block", "flat")
            for precision in ("float32", "mixed", "float64")
            for scene in SCENES
        ]
    print(table(rows))
    print("\nlimits in springs per second, every spring counted once for every pass over it")
    if options.json:
        options.json.write_text(
            json.dumps({"chips": CHIPS, "rows": rows}, indent=1, default=asdict)
        )
        print(f"wrote {options.json}")
    spilling = [row for row in rows if row["spilled"]]
    if spilling:
        sys.exit(f"{len(spilling)} kernels spill registers")


if __name__ == "__main__":
    main()
