"""Measure Gaussians on held-out views: PSNR and SSIM, on the object and over the full frame.

Nobody knows the exposure and white balance of a held-out photograph. The raw figures compare it with the
colors of the Gaussians as they are; the aligned ones first give these the gain that fits the photograph.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeAlias, overload

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.images import to_uint8
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import mask_box
from digs_warp.init.config import MASK_THRESHOLD
from digs_warp.measure.color_gain import OFFSET, ColorGain, fit_color_gain
from digs_warp.measure.metrics import mean_over, psnr, ssim_map
from digs_warp.measure.scores import ViewScore
from digs_warp.poses.in_training import filled_depth, motion_between, moved
from digs_warp.splat.blur_renderer import BlurRenderer
from digs_warp.splat.camera_motion import Blur, RowMotion
from digs_warp.splat.config import DEFAULT_OPTIONS, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.surface_depth import covered_depth
from digs_warp.train.exposure import INSIDE
from digs_warp.train.shutter import NO_SHUTTER, Shutter
from digs_warp.train.silhouette import without_surround


@dataclass(frozen=True, eq=False)
class TestView:
    """A held-out photograph, composited over white (values in 0..1), its mask (0..1) and object pixels.

    ``unknown``: pixels that show no scene, or at which something may hide the object, (height, width), bool;
    None: there are none.
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


# Memory for held-out photographs [bytes]. Beyond it, they are read whenever they are compared.
MEMORY = 256 * 2**20


class TestViews(Sequence[TestView]):
    """Held-out photographs, read at once as far as `MEMORY` goes: a long recording needs no more of it.

    Args:
        frames: of the photographs.
        shutter: how their cameras move.
        cameras: in other places; None: those of the frames.
        kept: photographs that were read before, by number.
    """

    def __init__(
        self,
        frames: Sequence[Frame],
        shutter: Shutter = NO_SHUTTER,
        cameras: Sequence[Camera] | None = None,
        kept: dict[int, TestView] | None = None,
    ) -> None:
        self._frames, self._shutter, self._kept = frames, shutter, {} if kept is None else kept
        self.cameras = [frame.camera for frame in frames] if cameras is None else [*cameras]
        room = MEMORY if kept is None else 0
        for number, frame in enumerate(frames):
            if room <= 0:
                break
            self._kept[number] = view = _test_view(frame, shutter)
            room -= view.target.nbytes + view.share.nbytes + view.object_pixels.nbytes

    def __len__(self) -> int:
        return len(self._frames)

    @overload
    def __getitem__(self, index: int) -> TestView: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[TestView]: ...
    def __getitem__(self, index: int | slice) -> TestView | Sequence[TestView]:
        if isinstance(index, slice):
            return [self[number] for number in range(len(self))[index]]
        number = range(len(self))[index]
        view = self._kept.get(number) or _test_view(self._frames[number], self._shutter)
        return replace(view, camera=self.cameras[number])

    def seen_from(self, cameras: Sequence[Camera]) -> "TestViews":
        """Return the same photographs with other cameras."""
        return TestViews(self._frames, self._shutter, cameras, self._kept)


def load_test_views(frames: Sequence[Frame], shutter: Shutter = NO_SHUTTER) -> TestViews:
    """Read the held-out photographs; without a mask, every pixel of a frame belongs to the object.

    The white replaces the room at the rim of the object, too, see `digs_warp.train.silhouette`.
    """
    return TestViews(frames, shutter)


def _test_view(frame: Frame, shutter: Shutter) -> TestView:
    photo, mask = frame.load_image(), frame.load_shown()
    image = without_surround(photo, mask).astype(np.float32) / 255.0
    share = mask[..., None].astype(np.float32) / 255.0
    target = image * share + (1.0 - share)
    return TestView(
        *(frame.name, frame.camera, target, share[..., 0], mask > MASK_THRESHOLD),
        *(frame.load_unknown(), shutter.rows_of(frame), shutter.blur_of(frame)),
    )


@dataclass(frozen=True, eq=False)
class Rendering:
    """Gaussians as a view shows them over white.

    Attributes:
        light: sRGB values, not clipped: what is brighter than white keeps its color under a smaller gain;
            shape (height, width, 3), float32.
        coverage: share of each pixel that the Gaussians cover, in 0..1, shape (height, width), float32.
        depth: of their centers [m], 0 where they cover less than half of a pixel, (height, width), float64;
            None: it was not asked for.
    """

    light: np.ndarray
    coverage: np.ndarray
    depth: np.ndarray | None = None

    @property
    def image(self) -> np.ndarray:
        """What a screen shows: values clipped to 0..1."""
        return np.clip(self.light, 0.0, 1.0)


def render_views(gaussians: DeviceGaussians, views: Sequence[TestView]) -> list[Rendering]:
    """Render the Gaussians in each view over white."""
    return list(drawn_views(gaussians, views))


def drawn_views(
    gaussians: DeviceGaussians,
    views: Sequence[TestView],
    options: RasterOptions = DEFAULT_OPTIONS,
    with_depth: bool = False,
) -> Iterator[Rendering]:
    """Render the views one after the other, so that many large ones need not be kept."""
    options = replace(options, outputs="mean depth" if with_depth else "color")
    center = gaussians.means.numpy().mean(axis=0)
    renderer, fits = None, (0, 0, 0)
    for view in views:
        k = view.camera.intrinsics
        needed = (k.width, k.height, view.blur.moments if view.blur else 1)
        if renderer is None or needed[:2] != fits[:2] or needed[2] > fits[2]:
            fits = needed
            renderer = BlurRenderer(gaussians, *fits[:2], options=options, moments=fits[2])
        near = near_plane(view.camera, center)
        renderer.forward(view.camera, near=near, rows=view.rows, blur=view.blur)
        behind = renderer.transmittance.to_numpy()[..., 0]
        whole = (0, 0, k.width, k.height)
        depth = covered_depth(renderer.middle, whole) if with_depth else None
        yield Rendering(renderer.image.to_numpy(), 1.0 - behind, depth)


@dataclass(frozen=True, eq=False)
class MeasuredViews:
    """Held-out views as Gaussians show them."""

    images: Sequence[np.ndarray]  # sRGB, (height, width, 3), uint8
    depths: Sequence[np.ndarray]  # of every `COARSE_STEP`-th pixel in both directions [m], float32
    scores: Sequence[ViewScore]  # beside the photographs


# Depth is kept of pixels this far from each other [px].
COARSE_STEP = 4
COARSE = (slice(None, None, COARSE_STEP), slice(None, None, COARSE_STEP))
_Measured: TypeAlias = tuple[np.ndarray, np.ndarray, ViewScore]


def measure_views(gaussians: DeviceGaussians, views: Sequence[TestView]) -> MeasuredViews:
    """Render the views, and compare them with their photographs while the next ones are rendered."""

    def measured(rendering: Rendering, view: TestView) -> _Measured:
        assert rendering.depth is not None
        depth = rendering.depth[COARSE].astype(np.float32)
        return to_uint8(rendering.image), depth, score_view(rendering, view)

    waiting: deque[Future[_Measured]] = deque()
    found: list[_Measured] = []
    with ThreadPoolExecutor(default_threads()) as pool:
        drawn = drawn_views(gaussians, views, with_depth=True)
        for rendering, view in zip(drawn, views, strict=True):
            waiting.append(pool.submit(measured, rendering, view))
            if len(waiting) > 2 * default_threads():  # or all of them would be held
                found.append(waiting.popleft().result())
        found += [each.result() for each in waiting]
    return MeasuredViews(*([each[part] for each in found] for part in range(3)))  # pyright: ignore


def color_aligned(rendering: Rendering, view: TestView) -> np.ndarray:
    """Return the image of a rendering with the photograph's exposure and white balance, in 0..1."""
    return with_gain(rendering, photographed_gain([rendering], [view]))


def photographed_gain(renderings: Sequence[Rendering], views: Sequence[TestView]) -> ColorGain:
    """Return the gain that turns the object in renderings into that in photographs of the same exposure."""
    return fit_color_gain(*_on_object(renderings, views))


def _on_object(
    renderings: Sequence[Rendering], views: Sequence[TestView]
) -> tuple[np.ndarray, np.ndarray]:
    """Return rendered and photographed sRGB values inside the object, (n, 3) each."""
    inside = [view.share >= INSIDE / 255.0 for view in views]
    rendered = [one.light[where] for one, where in zip(renderings, inside, strict=True)]
    photographed = [view.target[where] for view, where in zip(views, inside, strict=True)]
    return np.concatenate(rendered), np.concatenate(photographed)


def with_gain(rendering: Rendering, gain: ColorGain) -> np.ndarray:
    """Return the image of a rendering whose Gaussians, but not the white behind them, have a gain, in 0..1.

    A color c becomes s (c + o) - o, see `digs_warp.measure.color_gain`. A pixel with coverage a and the
    sum C of its Gaussians' colors, each times its share, becomes s (C + o a) - o a; the white stays.
    """
    x0, y0, x1, y1 = mask_box(rendering.coverage > 0.0)  # beside them there is only white
    part = (slice(y0, y1), slice(x0, x1))
    image, light = rendering.image, rendering.light[part]
    covered = rendering.coverage[part][..., None]
    factors = np.exp(gain.log_factors).astype(np.float32)
    own = light - (1.0 - covered)
    changed = (factors - 1.0) * (own + np.float32(OFFSET) * covered)
    image[part] = np.clip(light + changed, 0.0, 1.0)
    return image


def score_view(rendering: Rendering, view: TestView) -> ViewScore:
    """Compare a rendering with a photograph on white; without an object, its metrics are NaN."""
    image = rendering.image
    target, known = view.target_for(image), view.known
    aligned, similarity = color_aligned(rendering, view), ssim_map(image, target)
    return ViewScore(
        name=view.name,
        psnr_object=psnr(image, target, view.object_pixels),
        ssim_object=mean_over(similarity, view.object_pixels),
        psnr_object_aligned=psnr(aligned, target, view.object_pixels),
        psnr_frame=psnr(image, target, known),
        ssim_frame=mean_over(similarity, known),
        psnr_frame_aligned=psnr(aligned, target, known),
    )


# Sizes of the blocks of pixels that are compared, one after the other; over single pixels cameras shift, too.
POOLS = (4, 4, 2, 2, 1, 1, 1)


def moved_views(gaussians: DeviceGaussians, views: TestViews, shifts: bool = True) -> TestViews:
    """Return the views with cameras moved until the finished Gaussians fit, as those of the training did.

    Where poses are trained, those of held-out photographs are as far off as the others were: without this,
    their score would measure the poses (BARF, Lin et al., ICCV 2021, section 4.2, does the same). Without
    ``shifts``, cameras only turn.
    """
    found = views
    middle = np.median(gaussians.means.numpy(), axis=0)
    for pool in POOLS:
        renderings = drawn_views(gaussians, found, with_depth=shifts and pool == 1)
        cameras = []
        for rendering, view in zip(renderings, found, strict=True):
            image, pose = color_aligned(rendering, view), view.camera.world_from_cam
            box = mask_box(view.share)
            part = (slice(box[1], box[3]), slice(box[0], box[2]))
            photograph = view.target_for(image)[part]
            depth = None
            if rendering.depth is not None:
                depth = filled_depth(rendering.depth[part], photograph.shape[:2], pose, middle)
            k = view.camera.intrinsics
            motion = motion_between(image[part], photograph, k, box, pool, depth)
            cameras.append(replace(view.camera, world_from_cam=moved(pose, motion)))
        found = found.seen_from(cameras)
    return found
