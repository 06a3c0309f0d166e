"""One moment of a recording, which loads its pixels on demand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.decoded import decoded
from digs_warp.data.images import depth_in_metres, mask_of, read_image
from digs_warp.data.index_rules import INDEX_NAME, UNDISTORT
from digs_warp.data.layers import COLOR, METRES, NUMBERS, VECTORS, Layer
from digs_warp.data.objects import ObjectView, mask_of_text
from digs_warp.data.rig import UNKNOWN_EXPOSURE, Exposure
from digs_warp.geometry.camera import Camera

# What stands where a frame of the object alone shows something else [of 255].
BLANK = 128

# Where a layer's pixels are: in a file, or in an array with the values that the file would have.
PixelSource = Path | np.ndarray


@dataclass(frozen=True, eq=False)
class Frame:
    """One moment of a recording: the left camera, the time [s], and where its pixels are.

    ``layers`` has a file or an array for each layer of the frame; only `Layer.IMAGE` is always there. An
    array holds what the file would hold (8 bits of sRGB, 8 bits of mask, float32 metres of depth, ...), so
    both are decoded by the same code. ``color_gain``: factors of automatic exposure and white balance on red,
    green and blue in linear light, against the common exposure of the recording; None: unknown. ``objects``:
    how each object of `About.objects` appears; empty if the recorder does not tell. ``instance``: number of
    the one object that the mask shows; None: the mask shows everything that is wanted. ``exposure``: how long
    the shutter was open, and how the camera moved meanwhile. ``has_plain_masks``: the mask holds 0 to 255; in
    indices of other programs it may also be in alpha, or numbers of objects. ``alone``: image
    and depth are those of what the mask shows; elsewhere one is gray, the other unknown. ``stride``: every
    n-th row and column of what is stored is loaded; the camera is that of what is loaded.

    Images have shape (height, width). docs/formats.md defines the labels, which simulated recordings have on
    request; what is said of left and right holds for the infrared pair where the frame has one.
    """

    name: str
    camera: Camera
    time: float
    layers: Mapping[Layer, PixelSource]
    color_gain: tuple[float, float, float] | None = None
    objects: tuple[ObjectView, ...] = ()
    instance: int | None = None
    exposure: Exposure = UNKNOWN_EXPOSURE
    has_plain_masks: bool = True
    alone: bool = False
    stride: int = 1

    def load(self, layer: Layer) -> np.ndarray:
        """Return the pixels of a layer, as docs/formats.md defines them.

        Returns:
            uint8 or float32, (height, width), or (height, width, 3) of images, normals and flow. Depth [m]
            and disparities [px] are NaN where unknown. Flow is to the right and down until the next frame,
            and the change of disparity [px].

        Raises:
            CaptureError: the frame lacks the layer, or its file holds something else.
        """
        pixels = self._load(layer)
        if layer.kind == METRES:
            return depth_in_metres(pixels, self._where(layer))
        channels = 3 if layer.kind in (COLOR, VECTORS) else 1
        kind = "float32" if layer.kind in (NUMBERS, VECTORS) else "uint8"
        if pixels.dtype != kind or pixels.shape[2] < channels:
            raise CaptureError(
                f"{self._where(layer)}: {pixels.shape[2]} channels of {pixels.dtype}, expected {channels} of "
                f"{kind}; convert it to {'a float EXR' if kind == 'float32' else 'an 8-bit PNG'}"
            )
        return pixels[..., 0] if channels == 1 else np.ascontiguousarray(pixels[..., :3])

    def load_image(self) -> np.ndarray:
        """Return the left image, sRGB, shape (height, width, 3), uint8."""
        return self._of_object(self.load(Layer.IMAGE), BLANK)

    def load_right_image(self) -> np.ndarray:
        """Return the right image, sRGB, shape (height, width, 3), uint8.

        Its camera sits `digs_warp.data.capture.Capture.right_offset` metres along the x axis of the left one.
        """
        return self.load(Layer.RIGHT)

    def load_infrared(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the left and the right infrared image, each (height, width), uint8."""
        return self.load(Layer.INFRARED_LEFT), self.load(Layer.INFRARED_RIGHT)

    def load_depth(self) -> np.ndarray:
        """Return the sensed planar depth [m], shape (height, width), float32, NaN where unknown."""
        depth = self._of_object(self.load(Layer.DEPTH), np.nan)
        if self.has(Layer.UNKNOWN):
            depth[self.load(Layer.UNKNOWN) > 0] = np.nan
        return depth

    def load_depth_true(self) -> np.ndarray:
        """Return the true planar depth [m], shape (height, width), float32, NaN where unknown."""
        return self.load(Layer.DEPTH_TRUE)

    def load_mask(self) -> np.ndarray:
        """Return the object mask, 0..255, shape (height, width), uint8."""
        if self.has_plain_masks:
            return self.load(Layer.MASK)
        return mask_of(self._load(Layer.MASK), self.layers[Layer.MASK])[0]

    def load_cause(self) -> np.ndarray:
        """Return why each depth pixel is missing or wrong, shape (height, width), uint8; 0 if it is fine.

        `About.cause_labels` of the capture names the values.
        """
        return self.load(Layer.CAUSE)

    def load_confidence(self) -> np.ndarray:
        """Return the sensor's confidence in its depth, 0 to 1, shape (height, width), float32."""
        return self.load(Layer.CONFIDENCE).astype(np.float32) / np.float32(255)

    def load_instances(self) -> np.ndarray:
        """Return the number of the object at each pixel center, (height, width), uint8; 0: no object.

        `About.objects` of the capture names them, starting with number 1.
        """
        return self.load(Layer.INSTANCES)

    def load_unknown(self) -> np.ndarray | None:
        """Return where image and mask tell nothing of what is reconstructed, (height, width), bool.

        There is no scene, such as in the black border of an undistorted photograph, or another object may
        hide the one that is wanted. None: they tell something everywhere.
        """
        unknown = self.load(Layer.UNKNOWN) > 0 if self.has(Layer.UNKNOWN) else None
        if self.instance is None:
            return unknown
        numbers = self.load_instances()
        hidden = (numbers != 0) & (numbers != self.instance)
        return hidden if unknown is None else hidden | unknown

    def load_shown(self) -> np.ndarray:
        """Return the mask, 255 in a frame without one, and 0 where nothing is known."""
        k, unknown = self.camera.intrinsics, self.load_unknown()
        has_mask = self.has(Layer.MASK)
        mask = self.load_mask() if has_mask else np.full((k.height, k.width), 255, np.uint8)
        return mask if unknown is None else np.where(unknown, np.uint8(0), mask)

    def load_silhouette(self, view: ObjectView) -> np.ndarray:
        """Return the pixels of one of ``objects`` if nothing hid it, (height, width), bool.

        Raises:
            CaptureError: the index does not hold them in the form of `digs_warp.data.objects`.
        """
        if view.silhouette is None:
            return self.load_instances() == view.number
        k = self.camera.intrinsics
        try:
            return mask_of_text(view.silhouette, k.height, k.width)
        except ValueError as error:
            raise CaptureError(
                f"frame '{self.name}', object {view.number}: silhouette in {INDEX_NAME}: {error}; record "
                "it again"
            ) from error

    def has(self, layer: Layer) -> bool:
        """Whether the frame has this layer."""
        return layer in self.layers

    def path(self, layer: Layer) -> Path:
        """Return the file of a layer.

        Raises:
            CaptureError: the frame lacks the layer, or holds it in memory.
        """
        source = self._source(layer)
        if isinstance(source, Path):
            return source
        raise CaptureError(
            f"{self._where(layer)}: in memory, expected a file; simulate with out=FOLDER"
        )

    def every(self, stride: int) -> "Frame":
        """Return the frame with every n-th row and column of its images."""
        return replace(self, stride=stride, camera=self.camera.every(stride))

    def with_layer(self, layer: Layer, source: PixelSource) -> "Frame":
        """Return the frame with another source of a layer."""
        return replace(self, layers={**self.layers, layer: source})

    def without_layer(self, layer: Layer) -> "Frame":
        """Return the frame without a layer."""
        return replace(self, layers={k: v for k, v in self.layers.items() if k != layer})

    def _of_object(self, pixels: np.ndarray, elsewhere: float) -> np.ndarray:
        if self.alone:
            pixels[self.load_mask() <= 127] = elsewhere
        return pixels

    def _load(self, layer: Layer) -> np.ndarray:
        """Return the pixels as stored, shape (height, width, channels); the caller may change them."""
        source = self._source(layer)
        if isinstance(source, Path):
            pixels = decoded(source, partial(read_image, what=layer.label))
        else:
            pixels = source.reshape(*source.shape[:2], -1)
            pixels = pixels if self.stride > 1 else pixels.copy()
        if self.stride > 1:
            pixels = pixels[:: self.stride, :: self.stride].copy()
        k = self.camera.intrinsics
        if pixels.shape[:2] != (k.height, k.width):
            raise CaptureError(
                f"{self._where(layer)}: {pixels.shape[1]}x{pixels.shape[0]} pixels, expected "
                f"{k.width}x{k.height} as {INDEX_NAME} says; export the file again or correct w and h"
                + ("" if self.has_plain_masks else f"; {UNDISTORT} scales the camera")
            )
        return pixels

    def _source(self, layer: Layer) -> PixelSource:
        if layer not in self.layers:
            raise CaptureError(f"frame '{self.name}': the capture has no '{layer.value}'")
        return self.layers[layer]

    def _where(self, layer: Layer) -> str:
        """Name a layer in a message."""
        source = self.layers[layer]
        of_file = f"{layer.label} '{source}'"
        return of_file if isinstance(source, Path) else f"frame '{self.name}', {layer.label}"


def posed_at(frames: Sequence[Frame], poses: Sequence[np.ndarray] | np.ndarray) -> list[Frame]:
    """Return the frames with other poses ``world_from_cam``, (n, 4, 4)."""
    pairs = zip(frames, poses, strict=True)
    return [replace(f, camera=replace(f.camera, world_from_cam=pose)) for f, pose in pairs]
