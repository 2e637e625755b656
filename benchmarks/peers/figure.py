"""The plot: springs per second against the size of the population, for all programs."""

from pathlib import Path

__all__ = ["draw"]

#: Colour and style of each program; the others are grey.
STYLES = {
    "warp_springs": {"color": "#c2410c", "linewidth": 3.0, "zorder": 5},
    "C++ limit": {"color": "#111827", "linewidth": 1.8, "linestyle": (0, (4, 2))},
    "C++ plain": {"color": "#6b7280", "linestyle": ":"},
    "Taichi lanes": {"color": "#0f766e"},
    "Taichi": {"color": "#0f766e", "linestyle": ":"},
    "Numba lanes": {"color": "#1d4ed8"},
    "Numba": {"color": "#1d4ed8", "linestyle": ":"},
    "JAX unrolled": {"color": "#7e22ce"},
    "JAX": {"color": "#7e22ce", "linestyle": ":"},
    "NumPy": {"color": "#a16207", "linestyle": ":"},
    "Warp, two kernels": {"color": "#be185d", "linestyle": ":"},
    "Newton graph": {"color": "#4d7c0f"},
    "Newton": {"color": "#4d7c0f", "linestyle": ":"},
}


def draw(rows: list[dict], title: str, path: Path) -> None:
    """Draw rows of the sweep, each program's fastest number of threads, and write a picture."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6.4), layout="constrained")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel="robots", ylabel="springs per second")
    ends = []
    for name in dict.fromkeys(row["program"] for row in rows):
        best = {}
        for row in rows:
            rate = row["springs_per_second"]
            if row["program"] == name and rate:
                best[row["robots"]] = max(rate, best.get(row["robots"], 0.0))
        if not best:
            continue
        sizes = sorted(best)
        rates = [best[size] for size in sizes]
        style = {"color": "#9ca3af", "linewidth": 1.6} | STYLES.get(name, {})
        axes.plot(sizes, rates, marker="o", markersize=3.5, **style)
        ends.append((rates[-1], name, style["color"]))
    _label(axes, ends, max(row["robots"] for row in rows))
    axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
    axes.minorticks_off()
    axes.grid(which="major", color="#e5e7eb", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title(title, loc="left", fontsize=11)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)


def _label(axes, ends: list[tuple[float, str, str]], last: int) -> None:
    """Names at the ends of the lines, moved apart where they would overlap."""
    apart, below = 1.4, 0.0
    for rate, name, color in sorted(ends):
        below = max(rate, below * apart)
        bold = "bold" if name == "warp_springs" else "normal"
        axes.annotate(
            name,
            (last, rate),
            xytext=(last * 1.35, below),
            textcoords="data",
            color=color,
            fontsize=9,
            fontweight=bold,
            va="center",
            arrowprops={"arrowstyle": "-", "color": color, "linewidth": 0.6, "alpha": 0.6},
            annotation_clip=False,
        )
    axes.set_xlim(right=last * 1.2)
