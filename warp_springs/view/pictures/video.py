"""Films as files: H.264 in MP4 by ffmpeg, or animated WebP by Pillow, one picture at a time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warp_springs.view.pictures.film import Film

SUFFIXES = (".mp4", ".webp")
"""What the name of a film may end in."""

Progress = Callable[[float], None]

_QUALITY = 20  # of x264: 18 is visually lossless, 23 its default
_WEBP_QUALITY, _WEBP_EFFORT = 75, 4


def need_encoder(suffix: str) -> None:
    """Refuse a film that cannot be written for want of ffmpeg, before any work is done.

    Raises:
        RuntimeError: imageio-ffmpeg is not installed, or finds no ffmpeg.
    """
    if suffix == ".mp4":
        _ffmpeg()


def even(size: tuple[int, int], suffix: str) -> tuple[int, int]:
    """The size of a film's pictures: H.264 halves the colours' resolution and needs even sizes."""
    width, height = size
    return (width + width % 2, height + height % 2) if suffix == ".mp4" else (width, height)


def write_film(film: Film, path: Path, suffix: str, progress: Progress | None = None) -> None:
    """Write a film into a file; memory does not grow with its length.

    Args:
        film: What to write.
        path: Where to.
        suffix: ".mp4" or ".webp".
        progress: Called with the share that is done, 0 ... 1, after each picture.
    """
    write = _write_mp4 if suffix == ".mp4" else _write_webp
    write(film, path, progress or (lambda _: None))


def _ffmpeg():
    """The module that brings ffmpeg."""
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        raise RuntimeError(
            "an .mp4 film needs ffmpeg: pip install 'warp-springs[video]', or write .webp instead "
            f"({error})"
        ) from error
    return imageio_ffmpeg


def _write_mp4(film: Film, path: Path, progress: Progress) -> None:
    # no dates, versions or number of threads in the file: the same film gives the same bytes
    options = ["-crf", str(_QUALITY), "-preset", "medium", "-movflags", "+faststart"]
    options += ["-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"]
    options += ["-x264-params", "threads=4:lookahead-threads=1:sliced-threads=0"]
    options += ["-vf", "scale=out_color_matrix=bt709:out_range=tv"]
    options += ["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1"]
    sink = _ffmpeg().write_frames(
        str(path),
        film.size,
        fps=film.fps,
        codec="libx264",
        pix_fmt_out="yuv420p",
        quality=None,
        macro_block_size=1,
        output_params=options,
    )
    sink.send(None)
    try:
        for k, pixels in enumerate(film):
            sink.send(np.ascontiguousarray(pixels))
            progress((k + 1) / len(film))
    finally:
        sink.close()


def _write_webp(film: Film, path: Path, progress: Progress) -> None:
    frames = _lazy_images(film, progress)
    frames.save(
        path,
        format="WEBP",
        save_all=True,
        duration=_durations(len(film), film.fps),
        loop=0,
        quality=_WEBP_QUALITY,
        method=_WEBP_EFFORT,
        kmin=0,
        kmax=1,  # every picture whole: differences between lossy ones add up to stains
    )


def _durations(count: int, fps: float) -> list[int]:
    """How long each picture stays, in whole ms that add up without drift."""
    return np.diff(np.rint(np.arange(count + 1) * 1000.0 / fps)).astype(int).tolist()


def _lazy_images(film: Film, progress: Progress):
    """An image of Pillow's with many frames, each drawn when the encoder gets to it."""
    from PIL import Image

    class Frames(Image.Image):
        """Frames of a film."""

        n_frames = len(film)

        def show_frame(self, k: int) -> None:
            self.place = k
            self.im = Image.fromarray(film.picture(k)).im

        def seek(self, frame: int) -> None:
            if frame > self.place:
                self.show_frame(frame)
                progress((frame + 1) / self.n_frames)

        def tell(self) -> int:
            return self.place

    frames = Frames()
    frames._mode, frames._size = "RGB", film.size
    frames.show_frame(0)
    return frames
