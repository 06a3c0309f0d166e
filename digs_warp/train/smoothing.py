# Warp's stubs do not type device code:
# pyright: reportAttributeAccessIssue=false, reportOperatorIssue=false, reportGeneralTypeIssues=false
# pyright: reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
"""The filter in 3D: no splat is thinner than the images that trained it resolve.

An image that samples a surface at the distance p (the size of a pixel on it) tells nothing finer. So a splat
with the deviations s that are learned is drawn with

    s_eff^2 = s^2 + VARIANCE p^2,    dL/d ln s = (s / s_eff)^2 dL/d ln s_eff

in every renderer, at every image size: the filter is part of the scene. (The 3D smoothing filter of
Mip-Splatting, Yu et al., CVPR 2024, section 4.1, here in place of a dilation on the screen, too.) p is that
of the view that samples the splat most finely. It is computed anew now and then, as the splats move, and
taken as constant in between: p changes by a thousandth where a splat moves by a millimetre at a metre.

`DeviceGaussians.log_scales` always holds ln s_eff, which is what is drawn, measured and written. Only the
optimizer works on ln s.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import CLASSIC, NO_FILTER, Gaussians
from digs_warp.device.contiguous import flat, floats_from
from digs_warp.device.elementary import exp_of, log_of
from digs_warp.device.kernel_options import group_module_options
from digs_warp.device.parallel import ParallelLaunch, launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.splat.config import DEFAULT_OPTIONS
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import ViewParams, near_plane, view_params

wp.set_module_options(group_module_options())

# Variance of the filter, in squares of the sampling distance: that of the dilation of 3DGS at the size of the
# training images. Figures for others: docs/research/training-tried.md.
VARIANCE = 0.3

# A splat that starts thinner than the filter keeps this share of its variance as its own.
OWN_SHARE = 0.09

# Steps after which the sampling distances are computed anew.
SAMPLED_EVERY = 100

# Values that one thread filters.
BLOCK = 3 * 1024

_BLOCK = wp.constant(BLOCK)
_VARIANCE = wp.constant(VARIANCE)


@wp.kernel
def sampling_kernel(
    first: int,
    views: wp.array[ViewParams],
    means: wp.array[wp.vec3],
    # outputs
    distances: wp.array[float],
):
    """Return the size of a pixel [m] at a splat, in the view that samples it most finely.

    A splat that is in no image gets that of the nearest camera.
    """
    i = first + wp.tid()
    finest = float(wp.inf)
    nearest = float(wp.inf)
    for number in range(views.shape[0]):
        view = views[number]
        point = view.rotation * means[i] + view.translation
        size = 1.0 / wp.max(view.fx, view.fy)
        nearest = wp.min(nearest, wp.length(point) * size)
        if point[2] > view.near:
            u = view.fx * point[0] / point[2] + view.cx
            v = view.fy * point[1] / point[2] + view.cy
            if u >= 0.0 and v >= 0.0 and u <= float(view.width) and v <= float(view.height):
                finest = wp.min(finest, point[2] * size)
    distances[i] = wp.where(finest < wp.inf, finest, nearest)


@wp.kernel
def learned_kernel(
    first: int,
    count: int,
    learned: wp.array[float],  # ln s
    # outputs
    log_scales: wp.array[float],  # ln s_eff, then ln s
    gradients: wp.array[float],
):
    """Turn effective scales and their gradient into those that are learned."""
    begin = (first + wp.tid()) * _BLOCK
    size = wp.min(_BLOCK, count - begin)
    own = floats_from(learned, begin, size)
    scale = floats_from(log_scales, begin, size)
    gradient = floats_from(gradients, begin, size)
    if size == _BLOCK:  # only a loop of fixed length becomes vector code
        for i in range(_BLOCK):
            gradient[i] = gradient[i] * exp_of(2.0 * (own[i] - scale[i]))
            scale[i] = own[i]
    else:
        for j in range(size):
            gradient[j] = gradient[j] * exp_of(2.0 * (own[j] - scale[j]))
            scale[j] = own[j]


@wp.func
def effective(own: float, distance: float) -> float:
    """Return ln s_eff; NaN stays NaN."""
    scale = 0.5 * log_of(exp_of(2.0 * own) + _VARIANCE * distance * distance)
    return wp.where(own == own, scale, own)


@wp.kernel
def effective_kernel(
    first: int,
    count: int,
    widths: wp.array[float],  # p of its splat for each value: a vector loop cannot share it
    # outputs
    log_scales: wp.array[float],  # ln s, then ln s_eff
    learned: wp.array[float],
):
    """Keep the learned scales, and put effective ones in their place."""
    begin = (first + wp.tid()) * _BLOCK
    size = wp.min(_BLOCK, count - begin)
    own = floats_from(learned, begin, size)
    scale = floats_from(log_scales, begin, size)
    width = floats_from(widths, begin, size)
    if size == _BLOCK:
        for k in range(_BLOCK):
            own[k] = scale[k]
            scale[k] = effective(own[k], width[k])
    else:
        for j in range(size):
            own[j] = scale[j]
            scale[j] = effective(own[j], width[j])


def sampling_distances(
    means: wp.array, cameras: Sequence[Camera], center: np.ndarray | None = None
) -> wp.array:
    """Return the size of a pixel [m] of the finest view at each of n points, (n,).

    Args:
        means: the points, n vec3 on any device.
        cameras: of the views, at least one.
        center: of the scene [m], for the near planes; default: the mean of the points.
    """
    device = str(means.device)
    middle = means.numpy().mean(axis=0) if center is None else center
    records = [view_params(c, near_plane(c, middle), DEFAULT_OPTIONS) for c in cameras]
    views = wp.array(np.concatenate(records), dtype=ViewParams, device=device)  # pyright: ignore[reportArgumentType]
    distances = wp.zeros(len(means), dtype=float, device=device)
    launch_parallel(sampling_kernel, len(means), [views, means, distances], device)
    return distances


def without_filter(log_scales: np.ndarray, distances: np.ndarray, variance: float) -> np.ndarray:
    """Return ln s of s^2 = s_eff^2 - variance p^2, at least `OWN_SHARE` of s_eff^2; (n, 3), float64.

    Args:
        log_scales: ln s_eff, (n, 3).
        distances: p [m], (n,).
        variance: in squares of p.
    """
    whole = np.exp(2.0 * log_scales.astype(np.float64))
    added = variance * np.square(distances.astype(np.float64))
    return 0.5 * np.log(np.maximum(whole - added[:, None], OWN_SHARE * whole))


def for_classic_viewers(gaussians: Gaussians, cameras: Sequence[Camera]) -> Gaussians:
    """Return Gaussians that look in a viewer that adds 0.3 px^2 as these do in one that adds nothing.

    That holds at the size of the cameras' images: at others, such a viewer adds too much or too little.

    Raises:
        DigsError: they are made for such a viewer already.
    """
    if gaussians.screen_filter != NO_FILTER:
        raise DigsError(
            "these splats are already made for viewers that widen them on the screen; leave out --for"
        )
    means = wp.array(gaussians.means, dtype=wp.vec3, device="cpu")
    distances = sampling_distances(means, cameras).numpy()
    own = without_filter(gaussians.log_scales, distances, CLASSIC.dilation)
    return replace(gaussians, log_scales=own, screen_filter=CLASSIC)


class SmoothingFilter:
    """Filters the scales of ``gaussians`` in place.

    Args:
        gaussians: with the scales to start from, effective ones.
        gradients: of the loss in them.
        cameras: of the training views.

    Attributes:
        learned: ln s, (n,) vec3.
        distances: p [m], (n,).
    """

    def __init__(
        self, gaussians: DeviceGaussians, gradients: DeviceGaussians, cameras: Sequence[Camera]
    ) -> None:
        device = gaussians.device
        self._gaussians, self._cameras = gaussians, cameras
        self._center = gaussians.means.numpy().mean(axis=0)
        self._widths = wp.zeros(3 * len(gaussians), dtype=float, device=device)
        self._take(sampling_distances(gaussians.means, cameras, self._center))
        own = without_filter(gaussians.log_scales.numpy(), self.distances.numpy(), VARIANCE)
        self.learned = wp.array(own, dtype=wp.vec3, device=device)
        self._kept_alive = gradients  # a launch holds addresses only
        count = 3 * len(gaussians)
        scales, learned = flat(gaussians.log_scales), flat(self.learned)
        blocks = -(-count // BLOCK)
        given = [count, learned, scales, flat(gradients.log_scales)]
        self._before = ParallelLaunch(learned_kernel, blocks, given, device, even=True)
        given = [count, self._widths, scales, learned]
        self._after = ParallelLaunch(effective_kernel, blocks, given, device, even=True)
        gaussians.log_scales.assign(self.learned)
        self.after_update()

    def before_update(self) -> None:
        """Give the optimizer the learned scales and the gradient in them."""
        self._before.run()

    def after_update(self, step: int = 1) -> None:
        """Give the renderer the effective scales again; ``step``: steps taken."""
        if step % SAMPLED_EVERY == 0:
            means = self._gaussians.means
            self._take(sampling_distances(means, self._cameras, self._center))
        self._after.run()

    def _take(self, distances: wp.array) -> None:
        self.distances = distances
        self._widths.assign(np.repeat(distances.numpy(), 3))

    def state(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint has to hold."""
        return {"learned": self.learned.numpy(), "distances": self.distances.numpy()}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a `state`."""
        self.learned.assign(state["learned"])
        self._take(wp.array(state["distances"], dtype=float, device=self._gaussians.device))
        self._gaussians.log_scales.assign(self.learned)
        self._after.run()
