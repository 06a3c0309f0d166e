"""Frames -> one mask file each, from whatever source the settings name."""

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.file_names import masks_in
from digs_warp.data.frame import Frame
from digs_warp.data.images import mask_of, read_image, write_image
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.device.threads import default_threads
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.from_depth import mask_from_depth
from digs_warp.record.progress import progress

logger = logging.getLogger(__name__)

# Inside the folder of masks: those made for held-out frames.
HELD_OUT = "held_out"

# A mask that covers less or more of the image than this is worth a word.
ALMOST_EMPTY, ALMOST_FULL = 0.001, 0.98

# What each source reads of a frame.
_INPUTS = {
    "capture": (Layer.MASK,),
    "instance": (Layer.MASK, Layer.INSTANCES),
    "folder": (Layer.IMAGE,),
    "depth": (Layer.IMAGE, Layer.DEPTH),
}

MaskOf = Callable[[Frame], np.ndarray]


def segment(frames: Sequence[Frame], config: SegmentConfig, folder: Path) -> list[Path]:
    """Return the mask file of every frame: 8 bits, of the frame's size, 0 surely not object, 255 surely.

    New masks are written into ``folder`` as NAME.png.

    Args:
        frames: with image, and with depth or mask where the source needs it.
        config: the source and its settings.
        folder: where masks are written; created when missing. 'capture' writes nothing.

    Raises:
        DigsError: a frame lacks what the source needs, or a mask has another size than its image or not 8 or
            16 bits.
    """
    check_inputs(frames, config)
    if config.source == "capture":
        return [frame.path(Layer.MASK) for frame in frames]
    paths = [folder / f"{frame.name}.png" for frame in frames]
    _make(frames, paths, _mask_maker(frames, config))
    return paths


def with_masks(frames: Sequence[Frame], paths: Sequence[Path]) -> list[Frame]:
    """Return the frames with other mask files."""
    return [frame.with_layer(Layer.MASK, path) for frame, path in zip(frames, paths, strict=True)]


def masked(frames: PosedFrames, config: SegmentConfig, folder: Path) -> PosedFrames:
    """Make masks for the frames. Held-out frames keep theirs: the evaluation must not use our own masks.

    The masks of one of several objects are those of the recording; the frames know that others may hide it.
    """
    training = with_masks(frames.training, segment(frames.training, config, folder))
    held_out = list(frames.held_out)
    if config.source == "instance" or any(not frame.has(Layer.MASK) for frame in held_out):
        held_out = with_masks(held_out, segment(held_out, config, folder / HELD_OUT))
    found = replace(frames, training=tuple(training), held_out=tuple(held_out))
    if config.instance is None:
        return found
    return found.changed(lambda frame: replace(frame, instance=config.instance))


def _make(frames: Sequence[Frame], paths: Sequence[Path], mask_of: MaskOf) -> None:
    def work(frame: Frame, path: Path) -> float:
        mask = mask_of(frame)
        write_image(path, mask)
        return float(np.mean(mask > 127))

    odd: dict[str, list[str]] = {"empty": [], "full": []}
    with ThreadPoolExecutor(default_threads(), thread_name_prefix="mask") as pool:
        with progress(len(frames), "Masks", "frame") as bar:
            for frame, share in zip(frames, pool.map(work, frames, paths), strict=True):
                if share < ALMOST_EMPTY:
                    odd["empty"].append(frame.name)
                elif share > ALMOST_FULL:
                    odd["full"].append(frame.name)
                bar.update()
    for what, names in odd.items():
        if names:
            logger.warning(
                "masks: %d of %d are almost %s (the first is '%s'); look at them",
                *(len(names), len(frames), what, names[0]),
            )


def _mask_maker(frames: Sequence[Frame], config: SegmentConfig) -> MaskOf:
    if config.instance is not None:  # where the pixel's center shows the object; 0 elsewhere
        number = config.instance
        return lambda f: np.where(f.load_instances() == number, f.load_mask(), np.uint8(0))
    if config.masks == "depth":
        return lambda frame: mask_from_depth(frame.load_image(), frame.load_depth())
    assert config.mask_folder is not None
    files = masks_in(config.mask_folder, [frame.name for frame in frames])[0]
    return partial(_mask_from_folder, files)


def _mask_from_folder(files: dict[str, Path], frame: Frame) -> np.ndarray:
    """Return the frame's file as `mask_of` reads it."""
    path = files[frame.name]
    pixels = read_image(path, "mask")
    k = frame.camera.intrinsics
    if pixels.shape[:2] != (k.height, k.width):
        raise DigsError(
            f"mask '{path}': {pixels.shape[1]}x{pixels.shape[0]} pixels, expected {k.width}x{k.height} as "
            "its image has; segment the images of this recording at their full size"
        )
    return mask_of(pixels, path)[0]


def check_source(config: SegmentConfig) -> None:
    """Raise a `DigsError` when the folder that the settings name is missing."""
    if config.mask_folder is not None and not config.mask_folder.is_dir():
        raise DigsError(f"--mask-folder '{config.mask_folder}': no such folder. Check the path.")


def check_inputs(frames: Sequence[Frame], config: SegmentConfig) -> None:
    """Raise a `DigsError` when something that `segment` reads is missing."""
    check_source(config)
    for layer in _INPUTS[config.source]:
        lacking = [frame.name for frame in frames if not frame.has(layer)]
        if lacking:
            raise DigsError(
                f"masks: {len(lacking)} of {len(frames)} frames have no '{layer.value}' (the first is "
                f"'{lacking[0]}'), which --masks {config.masks} needs; choose another source"
            )
    if config.mask_folder is not None:
        names = [frame.name for frame in frames]
        lacking = sorted({*names} - masks_in(config.mask_folder, names)[0].keys())
        if lacking:
            raise DigsError(
                f"masks: '{config.mask_folder}' lacks the masks of {len(lacking)} of {len(frames)} frames, "
                f"the first is '{lacking[0]}.png'; masks are named like the frames"
            )
