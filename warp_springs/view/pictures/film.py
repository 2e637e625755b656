"""Pictures of one moment after the other: what is shown, from where, and with which words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_springs.view.look import Cut, Look
from warp_springs.view.pictures import labels as texts
from warp_springs.view.pictures.actors import Actor, FloatArray, actors_of
from warp_springs.view.pictures.directing import Director, Setting, put_on_grid, spread
from warp_springs.view.pictures.legend import Row, draw_legend, rows_of, strip_height
from warp_springs.view.pictures.rasteriser import Rasteriser
from warp_springs.view.pictures.scenery import draw_scene

if TYPE_CHECKING:
    from warp_springs.result import Result

Pixels = NDArray[np.uint8]

_LETTERS_PER_HEIGHT = 1 / 40
_SMALLEST_LETTERS = 9
_GUTTER = 4
_GUTTER_COLOR = (250, 251, 252)
_TILE_MAP = 512
_TILE_SHAPE = 1.4
_SAMPLES = 8
_APART, _BACK, _TRIES = 1.05, 1.02, 40
_MOST_HIDDEN = 0.08
"""Share of a robot's box in the picture that a neighbour's may cover on a grid."""


class Shot:
    """Robots in one picture or in one tile of a panel, from one camera.

    Attributes:
        actors: The robots at their places.
        director: Decides on the camera.
    """

    def __init__(
        self,
        actors: Sequence[Actor],
        setting: Setting,
        rasteriser: Rasteriser,
        *,
        labels: Sequence[str] | None = None,
        tile: bool = False,
        grid: bool = False,
    ):
        """Place the robots, the camera and the labels.

        Args:
            actors: The robots; on a grid they are moved.
            setting: Where, when and how they are shown.
            rasteriser: Draws; its size is that of the picture.
            labels: A text below each robot; in a tile, in its upper left corner.
            tile: Whether this is a tile of a panel.
            grid: Whether the robots are to be moved onto a grid.
        """
        self.actors, self._setting = actors, setting
        self._rasteriser, self._tile = rasteriser, tile
        self._floor = setting.scene.ground is not None
        letters = _letters(rasteriser.size[1])
        letters = max(letters, 14) if tile else letters
        self._images = [texts.text_image(label, letters) for label in labels or ()]
        self._drops = np.zeros(len(actors))
        cells = put_on_grid(actors) if grid else None
        self._direct()
        self._make_room(cells)

    def draw(self, time: float, share: float = 0.0) -> Pixels:
        """Return the picture at a time [s], after a share 0 ... 1 of the film."""
        drawing = draw_scene(self.actors, self._setting.scene, self._setting.look, time)
        camera = self.director.camera(time, share)
        pixels = self._rasteriser.draw(drawing, camera)
        if self._tile:
            for image in self._images:
                texts.lay_over(pixels, image, 8, 6)
            return pixels
        for image, box in zip(self._images, self._label_boxes(time, camera), strict=True):
            texts.lay_over(pixels, image, round(box[0]), round(box[1]))
        return pixels

    def _direct(self, back: float = 1.0) -> None:
        self.director = Director(self.actors, self._setting, self._rasteriser.size, tile=self._tile)
        self.director.stand_back(back)
        self._hang_labels()

    def _make_room(self, cells: FloatArray | None) -> None:
        """Move robots of a grid apart and the camera back until nothing hides anything."""
        apart = back = 1.0
        for _ in range(_TRIES if self._setting.look.camera is None else 0):
            crowded, cut_off = self._faults()
            if crowded and cells is not None:
                apart *= _APART
                spread(self.actors, cells, apart)
            elif cut_off:
                back *= _BACK
            else:
                break
            self._direct(back)

    def _samples(self) -> list[tuple[float, float]]:
        """Times that are looked at beforehand, and their shares of the film."""
        times = self._setting.times
        count = len(times)
        chosen = np.unique(np.linspace(0, count - 1, _SAMPLES).astype(int))
        return [(float(times[i]), i / count) for i in chosen]

    def _hang_labels(self) -> None:
        """Find how far below the place of a robot its label must hang to hide none of it."""
        if self._tile or not self._images:
            return
        self._drops = np.full(len(self.actors), -np.inf)
        for time, share in self._samples():
            camera = self.director.camera(time, share)
            for i, actor in enumerate(self.actors):
                below = self._seen(actor, time, camera)[3]
                anchor = self._anchor(actor, time, camera)[1]
                self._drops[i] = max(self._drops[i], below - anchor)

    def _label_boxes(self, time: float, camera) -> list[texts.Box]:
        boxes = []
        for actor, image, drop in zip(self.actors, self._images, self._drops, strict=False):
            middle, row, _ = self._anchor(actor, time, camera)
            boxes.append(texts.box_below(image, middle, row + drop))
        return boxes

    def _anchor(self, actor: Actor, time: float, camera) -> NDArray[np.float64]:
        """Where in the picture the middle of a robot stands on the floor."""
        place = np.append(actor.way(time)[:2], -actor.ball if self._floor else actor.way(time)[2])
        return camera.project(place[None], self._rasteriser.size)[0]

    def _seen(self, actor: Actor, time: float, camera) -> texts.Box:
        """The box of a robot in the picture."""
        size = self._rasteriser.size
        seen = camera.project(actor.positions(time), size)
        radius = camera.focal(size[1]) * actor.ball / np.maximum(seen[:, 2], 1e-9)
        low, high = (seen[:, :2] - radius[:, None]).min(0), (seen[:, :2] + radius[:, None]).max(0)
        return (*low, *high)

    def _faults(self) -> tuple[bool, bool]:
        """Whether something hides a robot or a label, and whether a label leaves the picture."""
        if self._tile:
            return False, False
        width, height = self._rasteriser.size
        crowded = cut_off = False
        for time, share in self._samples():
            camera = self.director.camera(time, share)
            robots = [self._seen(a, time, camera) for a in self.actors]
            words = self._label_boxes(time, camera) if self._images else []
            for i, word in enumerate(words):
                others = words[:i] + [r for k, r in enumerate(robots) if k != i]
                crowded |= any(texts.overlap(word, other) > 0.0 for other in others)
                cut_off |= min(word[:2]) < 0 or word[2] > width or word[3] > height
            crowded |= _hidden(robots) > _MOST_HIDDEN
        return crowded, cut_off


class Film:
    """All pictures of a film, each drawn when it is asked for.

    Attributes:
        size: Width and height in pixels.
        times: The time [s] of each picture.
        fps: Pictures per second of watching.
        shots: Each shot with the rows and columns of the picture that it fills.
    """

    def __init__(
        self,
        result: Result,
        robots: Sequence[int],
        look: Look,
        cut: Cut,
        rasteriser: Rasteriser,
        *,
        frame: int | None = None,
        moving: bool = True,
    ):
        """Place everything.

        Args:
            result: What `Simulation.run` returned.
            robots: Indices of the robots.
            look: How they are drawn.
            cut: Which part is shown and how the camera moves.
            rasteriser: Draws; its size is that of the pictures.
            frame: For a single picture: which recorded frame; None: the end of the run.
            moving: Whether this is more than a single picture.
        """
        self.size, self.fps, self._cut = rasteriser.size, cut.fps, cut
        self._caption = look.caption
        self._legend: list[Row] = []
        labels = texts.checked_labels(look.labels, len(robots))
        actors = actors_of(result, robots, look, frame, film=moving)
        self.times = _times(actors[0].times, cut) if moving else actors[0].times
        self.cycle = max((a.cycle for a in actors if math.isfinite(a.cycle)), default=math.inf)
        if look.legend:
            self._legend = rows_of(actors, look)
        layout = look.layout or _usual_layout(result, len(robots))
        setting = Setting(self.times, result.scene, look, cut)
        if layout != "panel" or len(actors) == 1:
            grid = layout == "grid" and len(actors) > 1
            shot = Shot(actors, setting, rasteriser, labels=labels, grid=grid)
            self.shots = [(shot, slice(None), slice(None))]
        else:
            self.shots = list(_panel(actors, setting, rasteriser, labels))

    def __len__(self) -> int:
        """Number of pictures."""
        return len(self.times)

    def __iter__(self) -> Iterator[Pixels]:
        """All pictures, (H, W, 3) uint8 sRGB each."""
        return (self.picture(k) for k in range(len(self)))

    def picture(self, k: int) -> Pixels:
        """Picture k, (H, W, 3) uint8 sRGB."""
        time, share = float(self.times[k]), k / len(self.times)
        pixels = np.empty((self.size[1], self.size[0], 3), np.uint8)
        pixels[:] = _GUTTER_COLOR
        for shot, rows, columns in self.shots:
            pixels[rows, columns] = shot.draw(time, share)
        self._write(pixels, time)
        return pixels

    def _write(self, pixels: Pixels, time: float) -> None:
        """Write the caption above, the clock and the legend below."""
        letters = _letters(self.size[1])
        if self._caption:
            texts.lay_over(pixels, texts.text_image(self._caption, letters), letters, letters)
        draw_legend(pixels, self._legend, letters, in_line=len(self.shots) > 1)
        if self._cut.clock and len(self.times) > 1:
            words = f"{time:.2f} s" + _speed_words(self._cut.speed)
            image = texts.text_image(words, letters)
            bottom = self.size[1] - image.shape[0] - letters // 2
            texts.lay_over(pixels, image, letters, bottom)


def _panel(
    actors: Sequence[Actor],
    setting: Setting,
    rasteriser: Rasteriser,
    labels: Sequence[str] | None,
) -> Iterator[tuple[Shot, slice, slice]]:
    """Tiles of a panel in the order of reading: a shot of one robot each, and its rows, columns."""
    whole = rasteriser.size
    strip = strip_height(_letters(whole[1])) if setting.look.legend else 0
    size = whole[0], whole[1] - strip
    columns = _columns(len(actors), size)
    rows = math.ceil(len(actors) / columns)
    width = (size[0] - (columns - 1) * _GUTTER) // columns
    height = (size[1] - (rows - 1) * _GUTTER) // rows
    if min(width, height) < 16:
        raise ValueError(f"size: {whole} is too small for a panel of {len(actors)}")
    small = rasteriser.of_size((width, height), _TILE_MAP)
    left = (size[0] - columns * width - (columns - 1) * _GUTTER) // 2
    top = (size[1] - rows * height - (rows - 1) * _GUTTER) // 2
    for i, actor in enumerate(actors):
        row, column = divmod(i, columns)
        y, x = top + row * (height + _GUTTER), left + column * (width + _GUTTER)
        words = None if labels is None else [labels[i]]
        shot = Shot([actor], setting, small, labels=words, tile=True)
        yield shot, slice(y, y + height), slice(x, x + width)


def _letters(height: int) -> int:
    """Height of the letters in a picture of a height, both in pixels."""
    return max(_SMALLEST_LETTERS, round(height * _LETTERS_PER_HEIGHT))


def _columns(count: int, size: tuple[int, int]) -> int:
    """How many columns a panel has: tiles of a good shape, few of them empty."""

    def fault(columns: int) -> float:
        rows = math.ceil(count / columns)
        shape = size[0] / columns / (size[1] / rows)
        return abs(math.log(shape / _TILE_SHAPE)) + (rows * columns - count) / count

    return min(range(1, count + 1), key=fault)


def _usual_layout(result: Result, count: int) -> str:
    """How several robots are shown unless somebody says so."""
    return "panel" if count > 1 and result.scene.obstacles else "grid"


def _times(recorded: NDArray[np.float64], cut: Cut) -> NDArray[np.float64]:
    """The times [s] of all pictures of a film."""
    first, last = float(recorded[0]), float(recorded[-1])
    start = first if cut.start is None else cut.start
    if not first <= start <= last:
        raise ValueError(f"start: got {start:g} s, the frames are of {first:g} to {last:g} s")
    end = last if cut.duration is None else min(start + cut.duration, last)
    count = max(1, round((end - start) * cut.fps / cut.speed))
    return start + np.arange(count) * (cut.speed / cut.fps)


def _speed_words(speed: float) -> str:
    """How fast a film runs, in words, unless it runs as the world does."""
    if speed == 1.0:
        return ""
    slower = 1.0 / speed
    if speed < 1.0 and abs(slower - round(slower)) < 1e-9:
        return f"   speed 1/{round(slower)}"
    return f"   speed × {speed:g}"


def _hidden(boxes: Sequence[texts.Box]) -> float:
    """The largest share of a box that another covers."""
    worst = 0.0
    for i, a in enumerate(boxes):
        for b in boxes[:i]:
            area = min((c[2] - c[0]) * (c[3] - c[1]) for c in (a, b))
            worst = max(worst, texts.overlap(a, b) / max(area, 1e-9))
    return worst
