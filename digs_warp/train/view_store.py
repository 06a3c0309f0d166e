"""The views of a run, prefetched in the background: a long recording needs no more memory than a short one.

The order of the views follows from (seed, step), so the store knows what comes next. It holds as many of the
next views as fit, and reads one more while the trainer works. If all views fit, each is read only once.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache, partial

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Camera
from digs_warp.record.progress import progress
from digs_warp.train.config import VIEW_ORDER, TrainConfig
from digs_warp.train.shutter import NO_SHUTTER, Shutter
from digs_warp.train.views import View, load_view

_MEGABYTE = 2**20

# The fewest views held: one in use, one ready, one on its way.
MIN_HELD = 3


def open_views(
    frames: Sequence[Frame],
    config: TrainConfig,
    first_step: int = 0,
    shutter: Shutter = NO_SHUTTER,
) -> "ViewStore":
    """Open the views of a run in the form that its settings require.

    Args:
        frames: the training frames; may differ in size.
        config: seed, device, memory, and which layers of a frame are needed.
        first_step: the step that the run starts at.
        shutter: how the cameras move while their rows are read.

    Raises:
        DigsError: there is no frame, or one of the first cannot be read.
    """

    def load(frame: Frame) -> View:
        return load_view(
            frame,
            config.device,
            with_depth=config.reads_depth(frame.has(Layer.DEPTH)),
            rows=shutter.rows_of(frame),
            blur=shutter.blur_of(frame),
        )

    order = partial(view_index, config.seed, len(frames))
    return ViewStore(frames, order, load, config.image_memory, first_step, shutter.moments)


def view_index(seed: int, count: int, step: int) -> int:
    """Return which of ``count`` views ``step`` uses: every epoch is a new shuffle."""
    epoch, position = divmod(step, count)
    return int(_order(seed, count, epoch)[position])


@lru_cache(maxsize=8)
def _order(seed: int, count: int, epoch: int) -> np.ndarray:
    return np.random.default_rng([seed, VIEW_ORDER, epoch]).permutation(count)


class ViewStore:
    """Hands out views by step.

    Args:
        frames: the training frames, at least one.
        index_of: returns the frame that a step (0, 1, ...) uses.
        load: reads a frame.
        memory: memory for views [MiB]; at least `MIN_HELD` views are held.
        first_step: the first step that `view` will be called with.
        moments: the most poses that a view is drawn from.

    Raises:
        DigsError: there is no frame.
    """

    def __init__(
        self,
        frames: Sequence[Frame],
        index_of: Callable[[int], int],
        load: Callable[[Frame], View],
        memory: float,
        first_step: int = 0,
        moments: int = 1,
    ) -> None:
        if not frames:
            raise DigsError("no training views; the capture needs at least two frames")
        self.moments = moments
        self._frames = frames
        self._index_of = index_of
        self._load = load
        self._held: dict[int, Future[View]] = {}
        self._readers = ThreadPoolExecutor(default_threads(), thread_name_prefix="views")
        self.capacity = self._fill(first_step, memory)

    def __len__(self) -> int:
        return len(self._frames)

    def frame(self, step: int) -> Frame:
        """Return the frame that a step uses."""
        return self._frames[self._index_of(step)]

    @property
    def cameras(self) -> list[Camera]:
        """The cameras of all views."""
        return [frame.camera for frame in self._frames]

    @property
    def names(self) -> list[str]:
        """The names of all views."""
        return [frame.name for frame in self._frames]

    @property
    def have_depth(self) -> bool:
        """Whether depth was measured in any of them."""
        return any(frame.has(Layer.DEPTH) for frame in self._frames)

    @property
    def have_masks(self) -> bool:
        """Whether an object is masked in any of them; otherwise they show a scene."""
        return any(frame.has(Layer.MASK) for frame in self._frames)

    def index(self, step: int) -> int:
        """Return which view ``step`` uses."""
        return self._index_of(step)

    def view(self, step: int) -> View:
        """Return the view of ``step``; call it with the steps in order."""
        if self.capacity < len(self._frames):
            self._move_on(step)
        return self._request(self._index_of(step)).result()

    def close(self) -> None:
        """Stop reading."""
        self._readers.shutdown(wait=True, cancel_futures=True)

    def _fill(self, first_step: int, memory: float) -> int:
        """Read the views of the first steps until the memory is full; return how many fit."""
        steps = range(first_step, first_step + 2 * len(self._frames))
        order = list(dict.fromkeys(self._index_of(step) for step in steps))
        room = memory * _MEGABYTE
        with progress(len(order), "Loading views", "view") as bar:
            for count, index in enumerate(order, start=1):
                for soon in order[count - 1 : count + default_threads()]:
                    self._request(soon)
                room -= self._request(index).result().bytes
                bar.update()
                if room < 0 and count >= MIN_HELD:
                    return count
        return len(order)

    def _move_on(self, step: int) -> None:
        """Drop the views that the next steps do not need, and request those that they do."""
        coming = [self._index_of(s) for s in range(step, step + self.capacity)]
        for index in set(self._held) - set(coming):
            del self._held[index]
        for index in coming:
            self._request(index)

    def _request(self, index: int) -> "Future[View]":
        if index not in self._held:
            self._held[index] = self._readers.submit(self._load, self._frames[index])
        return self._held[index]
