"""Loads the labels of a frame, which simulated recordings have on request (``--labels``)."""

from typing import Protocol

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.layers import Layer


class HasLayers(Protocol):
    """A frame that loads the pixels of a layer."""

    def _load(self, layer: Layer) -> np.ndarray: ...

    def _load_gray(self, layer: Layer) -> np.ndarray: ...

    def _load_depth(self, layer: Layer) -> np.ndarray: ...

    def _where(self, layer: Layer) -> str: ...


class LabelLoaders:
    """The part of `digs_warp.data.frame.Frame` that loads labels; docs/labels.md defines them.

    Images have shape (height, width). What is said of left and right holds for the infrared pair where the
    frame has one.
    """

    def load_normals(self: HasLayers) -> np.ndarray:
        """Return true unit normals in the world, toward the viewer, (height, width, 3), float32."""
        return _vectors(self, Layer.NORMALS, "x, y, z")

    def load_depth_right(self: HasLayers) -> np.ndarray:
        """Return the true planar depth of the right eye [m], float32, NaN where unknown."""
        return self._load_depth(Layer.DEPTH_RIGHT)

    def load_mask_right(self: HasLayers) -> np.ndarray:
        """Return the object mask of the right image, 0..255, uint8."""
        return self._load_gray(Layer.MASK_RIGHT)

    def load_disparity(self: HasLayers) -> np.ndarray:
        """Return columns to the left at which the right image shows the point [px], float32, NaN: unknown."""
        return _numbers(self, Layer.DISPARITY)

    def load_disparity_right(self: HasLayers) -> np.ndarray:
        """Return columns to the right at which the left image shows the point [px], float32."""
        return _numbers(self, Layer.DISPARITY_RIGHT)

    def load_occlusion(self: HasLayers) -> np.ndarray:
        """Return whether the right image shows the points of the left one.

        uint8, values of `digs_warp.data.occlusion.Occlusion`.
        """
        return self._load_gray(Layer.OCCLUSION)

    def load_occlusion_right(self: HasLayers) -> np.ndarray:
        """Return whether the left image shows the points of the right one, as `load_occlusion`."""
        return self._load_gray(Layer.OCCLUSION_RIGHT)

    def load_flow(self: HasLayers) -> np.ndarray:
        """Return how far each point moves to the right and down until the next frame [px].

        Shape (height, width, 2), float32; NaN where the point is behind the camera by then.
        """
        return _vectors(self, Layer.FLOW, "flow to the right, flow down, change of disparity")[
            ..., :2
        ]

    def load_disparity_change(self: HasLayers) -> np.ndarray:
        """Return the disparity of each point in the next frame minus that in this one [px], float32."""
        return _vectors(self, Layer.FLOW, "flow to the right, flow down, change of disparity")[
            ..., 2
        ]

    def load_flow_occlusion(self: HasLayers) -> np.ndarray:
        """Return whether the next image shows the points of this one, as `load_occlusion`."""
        return self._load_gray(Layer.FLOW_OCCLUSION)


def _numbers(frame: HasLayers, layer: Layer) -> np.ndarray:
    pixels = frame._load(layer)
    if pixels.dtype != np.float32:
        raise CaptureError(f"{frame._where(layer)}: {pixels.dtype}, expected a float EXR")
    return pixels[..., 0]


def _vectors(frame: HasLayers, layer: Layer, what: str) -> np.ndarray:
    pixels = frame._load(layer)
    if pixels.dtype != np.float32 or pixels.shape[2] != 3:
        raise CaptureError(
            f"{frame._where(layer)}: {pixels.shape[2]} channels of {pixels.dtype}, expected a float EXR "
            f"with {what}"
        )
    return pixels
