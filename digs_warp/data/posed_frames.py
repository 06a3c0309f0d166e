"""The frames as a reconstruction used them: metric cameras, masks, and which were held out.

These can differ from the recording's poses and masks: structure from motion estimates poses, and a
segmentation makes masks. ``cameras.json`` in the reconstruction's folder stores them.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame, PixelSource
from digs_warp.data.images import read_image, write_image
from digs_warp.data.layers import Layer
from digs_warp.record.fields import ABOVE_ZERO, Fields
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.words import counted

CAMERAS = "cameras.json"
MASKS = "masks"
# Layers that we may have made: their keys in cameras.json, and their folders.
_OURS = {Layer.MASK: ("mask", MASKS), Layer.UNKNOWN: ("no_scene", f"{MASKS}/no_scene")}


@dataclass(frozen=True, eq=False)
class PosedFrames:
    """Frames with metric cameras, in the order of the recording.

    Attributes:
        training: used for initialization and training.
        held_out: used to measure the result.
        sfm_per_metre: the scale of the structure from motion that gave the poses; None: the recording's own.
    """

    training: tuple[Frame, ...]
    held_out: tuple[Frame, ...]
    sfm_per_metre: float | None = None

    @property
    def by_time(self) -> list[tuple[Frame, bool]]:
        """All frames in the order of the recording, each with whether it is held out."""
        frames = [
            *((frame, False) for frame in self.training),
            *((frame, True) for frame in self.held_out),
        ]
        return sorted(frames, key=lambda entry: (entry[0].time, entry[0].name))

    def changed(self, change: Callable[[Frame], Frame]) -> "PosedFrames":
        """Return the frames, each changed."""
        training, held_out = tuple(map(change, self.training)), tuple(map(change, self.held_out))
        return replace(self, training=training, held_out=held_out)

    def named(self, names: Collection[str]) -> "PosedFrames":
        """Return those of the frames that have one of the names."""
        training, held_out = (
            tuple(frame for frame in group if frame.name in names)
            for group in (self.training, self.held_out)
        )
        return replace(self, training=training, held_out=held_out)

    def save(self, folder: Path) -> None:
        """Write cameras.json into the reconstruction's ``folder``."""
        entries = [
            _entry(frame, folder, held_out)
            for frames, held_out in ((self.training, False), (self.held_out, True))
            for frame in frames
        ]
        record = {"sfm_per_metre": self.sfm_per_metre, "frames": entries}
        write_atomically(Path(folder) / CAMERAS, to_json(record).encode())

    def moved(self, old: Path, new: Path) -> "PosedFrames":
        """Return the frames with masks in folder ``old`` taken from the same places in ``new``."""
        return self._with_masks_of(old, lambda mask: new / mask.relative_to(old))

    def with_masks_loaded(self, folder: Path) -> "PosedFrames":
        """Return the frames with masks in ``folder`` held in memory."""
        return self._with_masks_of(folder, lambda mask: read_image(mask)[..., 0])

    def _with_masks_of(self, folder: Path, change: Callable[[Path], PixelSource]) -> "PosedFrames":
        """Return the frames, masks and what is no scene changed where they are in ``folder``."""

        def changed(frame: Frame) -> Frame:
            for layer in _OURS:
                mask = frame.layers.get(layer)
                if isinstance(mask, Path) and mask.is_relative_to(folder):
                    frame = frame.with_layer(layer, change(mask))
            return frame

        return self.changed(changed)

    @staticmethod
    def split(capture: Capture, test_every: int) -> "PosedFrames":
        """Return the frames as recorded, the middle one of every ``test_every`` held out.

        Raises:
            DigsError: none is left to train on.
        """
        training, held_out = capture.split(test_every)
        if not training:
            raise DigsError(
                f"{capture}: {counted(len(capture), 'frame')}, expected at least 2: one is held out for the "
                "evaluation"
            )
        return PosedFrames(tuple(training), tuple(held_out))

    @staticmethod
    def as_recorded(capture: Capture) -> "PosedFrames":
        """Return all frames of a recording with its own cameras and masks; none is held out."""
        return PosedFrames(capture.frames, ())

    @staticmethod
    def load(capture: Capture, folder: Path) -> "PosedFrames":
        """Read what `save` wrote; the images stay those of ``capture``.

        Raises:
            DigsError: the file is missing or broken, or names a frame that the capture does not have.
        """
        path = Path(folder) / CAMERAS
        content = read_json(path, "cameras of the reconstruction")
        record = Fields(content, f"'{path}'", remedy="reconstruct again")
        frames = {frame.name: frame for frame in capture.frames}
        groups: dict[bool, list[Frame]] = {False: [], True: []}
        for entry in record.sections("frames"):
            name = entry.text("name")
            if name not in frames:
                raise DigsError(
                    f"'{path}': '{name}' is not in the {capture}; name the capture that was reconstructed"
                )
            frame = _posed(frames[name], entry, Path(folder))
            groups[entry.flag("held_out")].append(frame)
        scale = record.number("sfm_per_metre", ABOVE_ZERO, default=None, what="a number above 0")
        return PosedFrames(tuple(groups[False]), tuple(groups[True]), scale)


def _entry(frame: Frame, folder: Path, held_out: bool) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": frame.name,
        "held_out": held_out,
        "world_from_cam": frame.camera.world_from_cam.tolist(),
    }
    if frame.instance is not None:
        entry["instance"] = frame.instance
    # The recording's masks stay where they are; only masks that we made are in the reconstruction's folder.
    for layer, (key, place) in _OURS.items():
        mask = frame.layers.get(layer)
        if isinstance(mask, np.ndarray):  # not stored anywhere else
            pixels, mask = mask, Path(folder) / place / f"{frame.name}.png"
            write_image(mask, pixels)
        if mask is None and layer is Layer.MASK:
            entry[key] = None  # also where the recording has one
        elif mask is not None and mask.resolve().is_relative_to(Path(folder).resolve()):
            entry[key] = str(mask.resolve().relative_to(Path(folder).resolve()))
    return entry


def _posed(frame: Frame, entry: Fields, folder: Path) -> Frame:
    try:
        pose = entry.array("world_from_cam", (4, 4))
        posed = replace(
            frame,
            camera=replace(frame.camera, world_from_cam=pose),
            instance=entry.whole("instance", 1, default=None),
        )
    except DigsError as error:
        raise DigsError(f"{entry.where}: {error}; reconstruct again") from error
    for layer, (key, _) in _OURS.items():
        if key in entry.values:
            mask = entry.text(key, None)
            posed = posed.without_layer(layer)
            posed = posed if mask is None else posed.with_layer(layer, folder / mask)
    return posed
