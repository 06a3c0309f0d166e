"""The photographs to train on: cropped to the box of their mask, packed, and on the device."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import PixelBox, mask_box
from digs_warp.losses.depth import DepthTarget, depth_weights
from digs_warp.losses.regions import tiles_of
from digs_warp.losses.target import pack_view
from digs_warp.splat.camera_motion import Blur, RowMotion
from digs_warp.train.depth_errors import depth_samples
from digs_warp.train.exposure import Samples, color_samples
from digs_warp.train.silhouette import without_surround


@dataclass(frozen=True, eq=False)
class View:
    """One photograph.

    Attributes:
        name: name of its frame.
        camera: of the whole image.
        pixels: the planes of `pack_view` inside ``box``.
        box: the box of its mask; outside is only background. Empty without foreground.
        tiles: which tiles of 16x16 px have foreground, shape (tile rows, tile columns), bool.
        samples: pixels that tell its exposure.
        depth: what the depth camera measured inside ``box``; None if not requested.
        depth_samples: pixels that tell the errors of that depth; None like it.
        unknown: rows and columns of pixels at which something may hide the object, (2, n); None: none.
        rows: how the camera moves while its rows are read; None: not at all.
        blur: how it moves while the shutter is open; None: not at all.
    """

    name: str
    camera: Camera
    pixels: wp.array
    box: PixelBox
    tiles: np.ndarray
    samples: Samples
    depth: DepthTarget | None = None
    depth_samples: Samples | None = None
    unknown: np.ndarray | None = None
    rows: RowMotion | None = None
    blur: Blur | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the whole image [px]."""
        k = self.camera.intrinsics
        return k.width, k.height

    @property
    def bytes(self) -> int:
        """Memory of the view [bytes]."""
        held = self.pixels.size + self.samples.bytes
        if self.depth is not None:
            held += 5 * self.depth.depth.size
        if self.depth_samples is not None:
            held += self.depth_samples.bytes
        if self.unknown is not None:
            held += self.unknown.nbytes
        return held


def load_view(
    frame: Frame,
    device: str = "cpu",
    *,
    with_depth: bool = False,
    rows: RowMotion | None = None,
    blur: Blur | None = None,
) -> View:
    """Read one frame; without a mask, every pixel belongs to the object.

    The rim of the object gets its color alone, see `digs_warp.train.silhouette`.

    Args:
        frame: the frame.
        device: Warp device of the arrays.
        with_depth: also read the depth, and the confidence if there is one.
        rows: how the camera moves while its rows are read.
        blur: how it moves while the shutter is open.

    Raises:
        CaptureError: a file is missing, broken, or its size differs from the index.
    """
    image = frame.load_image()
    mask, unknown = frame.load_shown(), frame.load_unknown()
    photo = without_surround(image, mask)
    view = packed_view(frame.name, frame.camera, photo, mask, device, unknown)
    view = replace(view, rows=rows, blur=blur)
    if with_depth:
        confidence = frame.load_confidence() if frame.has(Layer.CONFIDENCE) else None
        depth = frame.load_depth()
        weights = depth_weights(image, mask, depth, confidence)
        view = _with_depth(view, depth, weights, device)
    return view


def packed_view(
    name: str,
    camera: Camera,
    image: np.ndarray,
    mask: np.ndarray,
    device: str = "cpu",
    unknown: np.ndarray | None = None,
) -> View:
    """Return a view of ``image`` (height, width, 3) and ``mask`` (height, width), both uint8.

    ``unknown``: where the mask tells nothing, (height, width), bool; None: nowhere.
    """
    box = mask_box(mask)
    inside = (slice(box[1], box[3]), slice(box[0], box[2]))
    pixels = wp.array(pack_view(image[inside], mask[inside]), dtype=wp.uint8, device=device)
    samples = color_samples(image, mask)
    hidden = (
        None if unknown is None or not unknown.any() else np.argwhere(unknown).T.astype(np.int32)
    )
    return View(name, camera, pixels, box, tiles_of(mask), samples, unknown=hidden)


def scene_extent(cameras: Sequence[Camera]) -> float:
    """Return the length [m] that scales the learning rate of the means.

    1.1 times the largest distance of a camera from the mean of all (3DGS); 1 if all are in one place.
    """
    centers = np.stack([camera.center_world for camera in cameras])
    spread = float(np.linalg.norm(centers - centers.mean(axis=0), axis=1).max())
    return 1.1 * spread if spread > 0 else 1.0


def _with_depth(view: View, depth: np.ndarray, weights: np.ndarray, device: str) -> View:
    box = view.box
    inside = (slice(box[1], box[3]), slice(box[0], box[2]))
    measured = np.nan_to_num(depth[inside]).astype(np.float32).reshape(-1)
    shares = weights[inside].reshape(-1)
    target = DepthTarget(
        wp.array(measured, dtype=float, device=device),
        wp.array(shares, dtype=wp.uint8, device=device),
        float(shares.sum(dtype=np.float64)) / 255.0,
    )
    return replace(view, depth=target, depth_samples=depth_samples(depth, weights))
