"""Pictures of a result: its robots at one moment, drawn as bars, spheres and skin on a floor."""

from __future__ import annotations

import numbers
import os
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_springs.view import appearance
from warp_springs.view.camera import Camera
from warp_springs.view.rasteriser import Drawing, Rasteriser

if TYPE_CHECKING:
    from warp_springs.result import Result

COLORS = ("stress", "plain")
"""What the colour of a bar may say."""

_FRAMES_FOR_SCALE = 64
_VIEW_OF_ONE = {"azimuth": -58.0, "elevation": 25.0, "margin": 1.6}
_VIEW_OF_MANY = {"azimuth": -64.0, "elevation": 28.0, "margin": 1.2}
_LABEL_INK = (28, 32, 38)
_LABEL_HALO = (232, 237, 242)


@dataclass(frozen=True)
class Pose:
    """One robot as it is drawn.

    Attributes:
        positions: Its masses in the picture's world, (M, 3) m.
        springs: (S, 2) indices of masses.
        faces: (T, 3) indices of masses.
        bar_color: (S, 3) linear RGB.
        bar_radius: m.
        ball_radius: m.
    """

    positions: NDArray[np.float64]
    springs: NDArray[np.int32]
    faces: NDArray[np.int32]
    bar_color: NDArray[np.float32]
    bar_radius: float
    ball_radius: float


def render(
    result: Result,
    path: str | os.PathLike[str],
    *,
    robots: int | Sequence[int] | None = None,
    frame: int | None = -1,
    size: tuple[int, int] = (1280, 720),
    color: str = "stress",
    skin: bool = True,
    camera: Camera | None = None,
    labels: Sequence[str] | None = None,
    device: str = "cpu",
) -> Path:
    """Write a picture of one or several robots as a PNG file and return its path.

    One robot is shown where it is; several are set side by side on a square grid in the order
    given. The floor is drawn one sphere's radius below z = 0, so that spheres rest on it. A file
    that exists is replaced only by a complete one.

    Args:
        result: What `Simulation.run` returned.
        path: File to write; its suffix must be .png.
        robots: Indices of the robots; default all that were recorded, or all without `frame`.
        frame: Which recorded frame, negative from the last; None: the end of the run, which
            needs no recording.
        size: Width and height in pixels.
        color: "stress": bars are red where stretched, blue where compressed; full colour is the
            95th percentile of the robot's forces over the run. "plain": all bars neutral.
        skin: Whether to draw the robots' faces.
        camera: Where to look from; default one that has all shown robots in the picture.
        labels: One text for each robot, written below it.
        device: Warp device that draws, "cpu" or "cuda:0".

    Raises:
        ValueError: For another suffix, a robot that does not exist or was not recorded, a frame
            out of range, an unknown colour, labels that do not match the robots.
        OSError: If the file cannot be written.
    """
    path = _checked_path(path)
    pixels = picture(
        result,
        robots=robots,
        frame=frame,
        size=size,
        color=color,
        skin=skin,
        camera=camera,
        labels=labels,
        device=device,
    )
    _save(pixels, path)
    return path


def picture(
    result: Result,
    *,
    robots: int | Sequence[int] | None = None,
    frame: int | None = -1,
    size: tuple[int, int] = (1280, 720),
    color: str = "stress",
    skin: bool = True,
    camera: Camera | None = None,
    labels: Sequence[str] | None = None,
    device: str = "cpu",
) -> NDArray[np.uint8]:
    """Return the picture that `render` writes, (H, W, 3) uint8 sRGB; arguments as there."""
    if color not in COLORS:
        raise ValueError(f"color must be one of {', '.join(map(repr, COLORS))}, got {color!r}")
    rasteriser = Rasteriser(size, device)
    robots = _checked_robots(result, robots, frame)
    if labels is not None and (isinstance(labels, str) or len(labels) != len(robots)):
        raise ValueError(f"labels must be {len(robots)} texts, one for each robot, got {labels!r}")
    poses = [pose(result, robot, frame, color) for robot in robots]
    if len(poses) > 1:
        poses = side_by_side(poses)
    drawing = arrange(poses, skin=skin, floor=result.scene.ground is not None)
    if camera is None:
        view = _VIEW_OF_ONE if len(poses) == 1 else _VIEW_OF_MANY
        camera = Camera.framing(drawing.points, rasteriser.size, radius=drawing.ball_radius, **view)
    pixels = rasteriser.draw(drawing, camera)
    if labels is None:
        return pixels
    return with_labels(pixels, poses, labels, camera)


def pose(result: Result, robot: int, frame: int | None = -1, color: str = "stress") -> Pose:
    """Return one robot of a result as it is drawn, where it is.

    Args:
        result: What `Simulation.run` returned.
        robot: Its index.
        frame: Which recorded frame, negative from the last; None: the end of the run.
        color: "stress" or "plain".

    Raises:
        ValueError: If the robot was not recorded or the frame is out of range.
        TypeError: If the frame is not a whole number or None.
    """
    body = result.robots[robot]
    if frame is None:
        positions, time = result.positions(robot), result.end_time
    else:
        frames = result.frames(robot)
        if not isinstance(frame, numbers.Integral):
            raise TypeError(f"frame must be a whole number or None, got {frame!r}")
        if not -len(frames) <= frame < len(frames):
            raise ValueError(
                f"frame {frame} is out of range: {len(frames)} frames were recorded, "
                f"{-len(frames)} ... {len(frames) - 1}"
            )
        positions, time = frames[frame], result.times[frame]
    bar_radius, ball_radius = appearance.drawn_radii(body.rest_length)
    if color == "stress":
        scale = _stress_scale(result, robot, positions, time)
        bar_color = appearance.stress_color(body.tension(positions, time), scale)
    else:
        bar_color = np.tile(np.float32(appearance.NEUTRAL), (body.n_springs, 1))
    return Pose(positions, body.springs, body.faces, bar_color, bar_radius, ball_radius)


def side_by_side(poses: Sequence[Pose], columns: int | None = None) -> list[Pose]:
    """Return the poses moved onto a square grid, their spheres resting on one floor."""
    extents = np.stack([(p.positions.min(axis=0), p.positions.max(axis=0)) for p in poses])
    offsets = appearance.grid_offsets(extents, columns)
    largest = max(p.ball_radius for p in poses)
    offsets[:, 2] += [p.ball_radius - largest for p in poses]
    return [
        Pose(p.positions + offset, p.springs, p.faces, p.bar_color, p.bar_radius, p.ball_radius)
        for p, offset in zip(poses, offsets, strict=True)
    ]


def arrange(poses: Sequence[Pose], *, skin: bool = True, floor: bool = True) -> Drawing:
    """Return all poses as one drawing.

    Args:
        poses: What to show.
        skin: Whether to draw faces.
        floor: Whether there is a floor; it lies below z = 0 by the radius of the largest sphere.
    """
    counts = [len(p.positions) for p in poses]
    masses = sum(counts)
    starts = np.cumsum(counts) - counts
    triangles = [p.faces + start for p, start in zip(poses, starts, strict=True) if skin]
    triangles = np.concatenate([np.zeros((0, 3), np.int32), *triangles])
    sizes = [np.linalg.norm(np.ptp(p.positions, axis=0)) for p in poses]
    return Drawing(
        points=np.concatenate([p.positions for p in poses]),
        triangles=triangles,
        triangle_color=np.tile(np.float32(appearance.SKIN), (len(triangles), 1)),
        bars=np.concatenate([p.springs + s for p, s in zip(poses, starts, strict=True)]),
        bar_radius=np.repeat([p.bar_radius for p in poses], [len(p.springs) for p in poses]),
        bar_color=np.concatenate([p.bar_color for p in poses]),
        balls=np.arange(masses, dtype=np.int32),
        ball_radius=np.repeat([p.ball_radius for p in poses], counts),
        ball_color=np.tile(np.float32(appearance.MASS), (masses, 1)),
        floor=-max(p.ball_radius for p in poses) if floor else None,
        tile=appearance.tile_size(sizes),
    )


def with_labels(
    pixels: NDArray[np.uint8], poses: Sequence[Pose], labels: Sequence[str], camera: Camera
) -> NDArray[np.uint8]:
    """Return a picture, (H, W, 3) uint8, with a text below each robot."""
    import matplotlib
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(pixels)
    draw = ImageDraw.Draw(image)
    file = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")
    font = ImageFont.truetype(str(file), max(10, image.height // 40))
    for p, label in zip(poses, labels, strict=True):
        seen = camera.project(p.positions, image.size)
        seen = seen[seen[:, 2] > 0]
        if len(seen) == 0:
            continue
        left, right = seen[:, 0].min(), seen[:, 0].max()
        below = seen[:, 1].max() + camera.focal(image.height) * 2 * p.ball_radius / seen[:, 2].min()
        draw.text(
            ((left + right) / 2, below),
            str(label),
            fill=_LABEL_INK,
            font=font,
            anchor="ma",
            align="center",
            stroke_width=max(1, image.height // 360),
            stroke_fill=_LABEL_HALO,
        )
    return np.array(image)


def _stress_scale(result: Result, robot: int, positions: NDArray, time: float) -> float:
    """Return the force in N shown in full colour: from the whole run where it was recorded."""
    body = result.robots[robot]
    if robot in result.recorded and len(result.times):
        step = max(1, len(result.times) // _FRAMES_FOR_SCALE)
        frames, times = result.frames(robot)[::step], result.times[::step]
        return appearance.stress_scale(body.tension(frames, times))
    return appearance.stress_scale(body.tension(positions, time))


def _checked_robots(
    result: Result, robots: int | Sequence[int] | None, frame: int | None
) -> list[int]:
    """Return the indices of the robots to show, or say what is wrong with them."""
    n = len(result.robots)
    if robots is None:
        robots = range(n) if frame is None else result.recorded
        if len(robots) == 0:
            raise ValueError(
                "no robot was recorded: run with fps= for frames, or show the end with frame=None"
            )
    elif np.ndim(robots) == 0:
        robots = [robots]
    robots = [int(robot) for robot in robots]
    if not robots:
        raise ValueError("robots must name at least one robot, got none")
    for robot in robots:
        if not 0 <= robot < n:
            raise ValueError(f"robot {robot} does not exist: the result holds 0 ... {n - 1}")
        if frame is not None and robot not in result.recorded:
            known = ", ".join(map(str, result.recorded[:8])) or "none"
            more = " ..." if len(result.recorded) > 8 else ""
            raise ValueError(f"robot {robot} was not recorded; recorded are {known}{more}")
    return robots


def _checked_path(path: str | os.PathLike[str]) -> Path:
    """Return the path of a picture that can be written, or say why it cannot."""
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise ValueError(f"a picture's file must end in .png, got {str(path)!r}")
    if path.is_dir():
        raise IsADirectoryError(f"cannot write a picture to {str(path)!r}: it is a folder")
    if not path.parent.is_dir():
        raise FileNotFoundError(
            f"cannot write a picture to {str(path)!r}: there is no folder {str(path.parent)!r}"
        )
    return path


def _save(pixels: NDArray[np.uint8], path: Path) -> None:
    """Write a PNG beside its place, then put it there in one step."""
    from PIL import Image

    beside = path.with_name(f".{path.stem}-{uuid.uuid4().hex[:8]}.part")
    try:
        Image.fromarray(pixels).save(beside, format="PNG", compress_level=6)
        beside.replace(path)
    except OSError as error:
        reason = f"cannot write a picture to {str(path)!r}: {error.strerror}"
        raise OSError(error.errno, reason) from error
    finally:
        beside.unlink(missing_ok=True)
