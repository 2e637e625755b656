"""Pictures and films of a result: its robots as bars, spheres and skin on a floor."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_springs.io.outputs import checked_output, written_beside
from warp_springs.view.look import LEAST_CYCLES, Cut, Look
from warp_springs.view.pictures import video
from warp_springs.view.pictures.camera import Camera
from warp_springs.view.pictures.film import Film
from warp_springs.view.pictures.rasteriser import Rasteriser

if TYPE_CHECKING:
    from warp_springs.result import Result

_LOOK = [field.name for field in fields(Look)]
_CUT = [field.name for field in fields(Cut)]


def render(
    result: Result,
    path: str | os.PathLike[str],
    *,
    robots: int | Sequence[int] | None = None,
    frame: int | None = -1,
    size: tuple[int, int] = (1280, 720),
    layout: str | None = None,
    color: str = "stress",
    skin: bool | str = True,
    bars: bool = True,
    balls: bool = True,
    thickness: float = 1.0,
    camera: Camera | None = None,
    azimuth: float | None = None,
    elevation: float | None = None,
    labels: Sequence[str] | None = None,
    caption: str | None = None,
    legend: bool = False,
    fps: float = 30.0,
    speed: float = 1.0,
    start: float | None = None,
    duration: float | None = None,
    follow: bool = True,
    turns: float = 0.0,
    clock: bool = True,
    device: str = "cpu",
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write a picture (.png) or a film (.mp4, .webp) of one or several robots; return its path.

    The floor is drawn one sphere's radius below z = 0, so that spheres rest on it. Obstacles and
    the external forces of the moment are shown. A file that exists is replaced only by a complete
    one. The same result gives the same bytes, with any number of threads.

    Args:
        result: What `Simulation.run` returned.
        path: File to write. MP4 is H.264 that plays everywhere, its sizes rounded up to even
            numbers; it needs the extra ``video``. Animated WebP needs nothing.
        robots: Indices of the robots; default all that were recorded, or all without `frame`.
        frame: For a picture: which recorded frame, negative from the last; None: the end of the
            run, which needs no recording.
        size: Width and height in pixels.
        layout: How several robots are shown. "grid": side by side in one world, far enough apart
            for all their motion, labels on nobody. "panel": each in a tile of its own with a
            camera of its own. "world": where they are. Default "grid", or "panel" where the scene
            has obstacles.
        color: "stress": bars are red where stretched, blue where compressed; full colour is the
            95th percentile of the robot's forces over the run. "material": by what they are made
            of, by stiffness without materials. "actuation": orange where told to be longer, green
            where told to be shorter than on average. "plain": all bars neutral.
        skin: Whether to draw the robots' faces, or their colour "#rrggbb".
        bars: Whether to draw the springs.
        balls: Whether to draw the masses.
        thickness: Of bars and spheres, in units of the usual one.
        camera: Where to look from; default one that has all shown robots in the picture.
        azimuth: Where the default camera stands around the vertical, degrees from +x towards +y.
        elevation: How high it stands above the horizon, degrees.
        labels: One text for each robot, written below it or into its tile.
        caption: A text in the upper left corner.
        legend: Whether to say in the lower right corner what the colours mean.
        fps: Pictures per second of a film.
        speed: Seconds of the run per second of the film: 0.25 is slow motion. Between recorded
            frames, motion is a smooth curve through them.
        start: Where in the run a film starts [s]; default its first frame.
        duration: How much of the run it shows [s]; default all of it. A run of fewer than three
            cycles of the muscles is shown with a warning.
        follow: Whether the camera of a film goes along with the robots.
        turns: How often it goes around them in the whole film.
        clock: Whether a film shows the time of the run, and its speed if it is not that of life.
        device: Warp device that draws, "cpu" or "cuda:0".
        threads: Threads that draw on a CPU; default one for each core.
        progress: Called with the share of a film that is done, 0 ... 1.

    Raises:
        ValueError: For another suffix, a robot that does not exist or was not recorded, a frame
            out of range, an unknown colour, labels that do not match the robots, and so on.
        RuntimeError: For .mp4 without ffmpeg.
        OSError: If the file cannot be written.
    """
    given = dict(locals())
    options = {name: given[name] for name in (*_LOOK, *_CUT)}
    path = checked_output(path, (".png", *video.SUFFIXES))
    suffix = path.suffix.lower()
    moving = suffix in video.SUFFIXES
    video.need_encoder(suffix)
    size = video.even(size, suffix) if moving and np.shape(size) == (2,) else size
    rasteriser = Rasteriser(size, device, threads)
    film = _film(result, robots, rasteriser, frame=frame, moving=moving, options=options)
    if moving:
        _warn_of_few_cycles(film)
    with written_beside(path) as draft:
        try:
            if moving:
                video.write_film(film, draft, suffix, progress)
            else:
                _save_png(film.picture(0), draft)
        except OSError as error:
            what = "film" if moving else "picture"
            raise OSError(
                error.errno, f"cannot write a {what} to {str(path)!r}: {error.strerror or error}"
            ) from error
    return path


def picture(
    result: Result,
    *,
    robots: int | Sequence[int] | None = None,
    frame: int | None = -1,
    size: tuple[int, int] = (1280, 720),
    device: str = "cpu",
    threads: int | None = None,
    **options: Any,
) -> NDArray[np.uint8]:
    """Return the picture that `render` writes, (H, W, 3) uint8 sRGB; arguments as there."""
    rasteriser = Rasteriser(size, device, threads)
    film = _film(result, robots, rasteriser, frame=frame, moving=False, options=options)
    return film.picture(0)


def _film(
    result: Result,
    robots: int | Sequence[int] | None,
    rasteriser: Rasteriser,
    *,
    frame: int | None,
    moving: bool,
    options: dict[str, Any],
) -> Film:
    """Return a film, or a film of one picture, with the options that `render` takes."""
    look = Look(**{name: options[name] for name in _LOOK if name in options})
    cut = Cut(**{name: options[name] for name in _CUT if name in options})
    chosen = _checked_robots(result, robots, recorded=moving or frame is not None)
    return Film(result, chosen, look, cut, rasteriser, frame=frame, moving=moving)


def _warn_of_few_cycles(film: Film) -> None:
    """Say so if a film shows fewer cycles of the muscles than one needs to judge a gait."""
    if math.isinf(film.cycle) or len(film.times) < 2:
        return
    step = float(film.times[1] - film.times[0])
    shown = len(film.times) * step / film.cycle
    if shown + step / film.cycle < LEAST_CYCLES:
        warnings.warn(
            f"the film shows {shown:.1f} cycles of the muscles; for {LEAST_CYCLES} record "
            f"{LEAST_CYCLES * film.cycle:.3g} s",
            stacklevel=3,
        )


def _checked_robots(
    result: Result, robots: int | Sequence[int] | None, recorded: bool
) -> list[int]:
    """Return the indices of the robots to show, or say what is wrong with them."""
    n = len(result.robots)
    if robots is None:
        robots = result.recorded if recorded else range(n)
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
        if recorded and robot not in result.recorded:
            known = ", ".join(map(str, result.recorded[:8])) or "none"
            more = " ..." if len(result.recorded) > 8 else ""
            raise ValueError(f"robot {robot} was not recorded; recorded are {known}{more}")
    return robots


def _save_png(pixels: NDArray[np.uint8], path: Path) -> None:
    from PIL import Image

    Image.fromarray(pixels).save(path, format="PNG", compress_level=6)
