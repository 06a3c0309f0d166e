"""Measure Gaussians on held-out views: PSNR and SSIM, on the object and over the full frame.

Nobody knows the exposure and white balance of a held-out photograph. The raw figures compare it with the
colors of the Gaussians as they are; the aligned ones first give these the gain that fits the photograph.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from digs_warp.camera import Camera
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.threads import default_threads
from digs_warp.geometry import mask_box
from digs_warp.measure.color_gain import ColorGain, fit_color_gain
from digs_warp.measure.metrics import mean_over, psnr, ssim_map
from digs_warp.measure.scores import ViewScore
from digs_warp.splat.blur import Blur
from digs_warp.splat.blur_renderer import BlurRenderer
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.row_motion import RowMotion
from digs_warp.train.exposure import INSIDE
from digs_warp.train.shutter import NO_SHUTTER, ShutterPlan
from digs_warp.train.silhouette import without_surround

# The paper's mask threshold tau (section 4.1): a pixel above it belongs to the object.
MASK_THRESHOLD = 20


@dataclass(frozen=True, eq=False)
class TestView:
    """A held-out photograph, composited over white (values in 0..1), its mask (0..1) and object pixels.

    ``unknown``: pixels at which something may hide the object, (height, width), bool; None: nothing does.
    ``rows``: how its camera moves while the rows are read; None: not at all. ``blur``: how it moves while the
    shutter is open; None: not at all.
    """

    name: str
    camera: Camera
    target: np.ndarray
    share: np.ndarray
    object_pixels: np.ndarray
    unknown: np.ndarray | None = None
    rows: RowMotion | None = None
    blur: Blur | None = None

    def target_for(self, image: np.ndarray) -> np.ndarray:
        """Return the target of a rendered image: the image itself where the photograph tells nothing."""
        if self.unknown is None:
            return self.target
        return np.where(self.unknown[..., None], image, self.target)

    @property
    def known(self) -> np.ndarray | None:
        """The pixels to compare, (height, width), bool; None: all."""
        return None if self.unknown is None else ~self.unknown


def load_test_views(frames: Sequence[Frame], shutter: ShutterPlan = NO_SHUTTER) -> list[TestView]:
    """Read the held-out photographs; without a mask, every pixel of a frame belongs to the object.

    The white replaces the room at the rim of the object, too, see `digs_warp.train.silhouette`.
    """
    views = []
    for frame in frames:
        photo = frame.load_image()
        mask = np.full(photo.shape[:2], 255, np.uint8)
        if frame.has(Layer.MASK):
            mask = frame.load_mask()
        image = without_surround(photo, mask).astype(np.float32) / 255.0
        share = mask[..., None].astype(np.float32) / 255.0
        target = image * share + (1.0 - share)
        views.append(
            TestView(
                *(frame.name, frame.camera, target, share[..., 0], mask > MASK_THRESHOLD),
                *(frame.load_unknown(), shutter.rows_of(frame), shutter.blur.of(frame)),
            )
        )
    return views


def render_views(gaussians: DeviceGaussians, views: Sequence[TestView]) -> list[np.ndarray]:
    """Render the Gaussians in each view over white; return images clipped to 0..1, (height, width, 3)."""
    center = gaussians.means.numpy().mean(axis=0)
    moments = max((view.blur.moments for view in views if view.blur), default=1)
    images = []
    renderer = None
    for view in views:
        k = view.camera.intrinsics
        if renderer is None or (renderer.image.width, renderer.image.height) != (k.width, k.height):
            renderer = BlurRenderer(gaussians, k.width, k.height, moments=moments)
        near = near_plane(view.camera, center)
        renderer.forward(view.camera, near=near, rows=view.rows, blur=view.blur)
        images.append(np.clip(renderer.image.to_numpy(), 0.0, 1.0))
    return images


def score_views(images: Sequence[np.ndarray], views: Sequence[TestView]) -> list[ViewScore]:
    """Compare rendered images with photographs on white; without an object, its metrics are NaN."""
    with ThreadPoolExecutor(default_threads()) as pool:
        scores = [
            pool.submit(_score, image, view) for image, view in zip(images, views, strict=True)
        ]
        return [score.result() for score in scores]


def color_aligned(image: np.ndarray, view: TestView) -> np.ndarray:
    """Return an image rendered over white with the photograph's exposure and white balance, in 0..1."""
    return with_gain(image, view, photographed_gain(image, view))


def photographed_gain(image: np.ndarray, view: TestView) -> ColorGain:
    """Return the gain that turns the object in an image rendered over white into the photographed one."""
    inside = view.share >= INSIDE / 255.0
    return fit_color_gain(image[inside], view.target[inside])


def with_gain(image: np.ndarray, view: TestView, gain: ColorGain) -> np.ndarray:
    """Return an image rendered over white whose object has a gain, in 0..1."""
    x0, y0, x1, y1 = mask_box(view.share)
    box = (slice(y0, y1), slice(x0, x1))  # elsewhere there is nothing to change
    share, part = view.share[box][..., None], image[box]
    # Only the object's part of a pixel at its rim has the gain.
    color = np.clip((part - (1 - share)) / np.maximum(share, 1e-6), 0.0, 1.0)
    aligned = np.clip(image, 0.0, 1.0)
    aligned[box] = np.clip(part + share * (gain.applied(color) - color), 0.0, 1.0)
    return aligned


def _score(image: np.ndarray, view: TestView) -> ViewScore:
    target, known = view.target_for(image), view.known
    aligned, similarity = color_aligned(image, view), ssim_map(image, target)
    return ViewScore(
        name=view.name,
        psnr_object=psnr(image, target, view.object_pixels),
        ssim_object=mean_over(similarity, view.object_pixels),
        psnr_object_aligned=psnr(aligned, target, view.object_pixels),
        psnr_frame=psnr(image, target, known),
        ssim_frame=mean_over(similarity, known),
        psnr_frame_aligned=psnr(aligned, target, known),
    )
