"""Depth supervision: pulls the rendered expected depth toward the measured depth.

Legend: z rendered depth, d measured depth [m], I the photograph, c the sensor's confidence in 0..1.

    L = sum w log(1 + |z - d'| / s) / sum w,   s = ERROR_SHARE d'
    d' = 1 / (1/d - b): the measured depth without the bias b of the camera's disparity [1/m], usually 0
    w = c exp(-|grad I|) where the depth is known and the object covers the pixel, else 0

The logarithm limits the effect of outliers. The factor exp(-|grad I|) lowers the weight of image edges,
where stereo depth bleeds from one surface to the other (the edge-aware log-L1 of DN-Splatter, Turkulainen
et al. 2024). That paper takes |z - d| in units of the scene, metres for rooms; a relative error works for
objects of any size.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.contiguous import bytes_from, fill, floats_from
from digs_warp.device.elementary import larger, log_of
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch, put
from digs_warp.geometry.rigid import PixelBox, mask_box

wp.set_module_options({"enable_backward": False, "max_unroll": 1})

# Relative error above which the logarithm flattens: about that of a stereo camera close to an object.
ERROR_SHARE = 0.01
# A pixel with less coverage is at the rim, where the rendered depth is a mean of near and far.
MIN_COVERAGE = 0.5
# Mask values from this on belong to the object.
OBJECT = 128

# Only loops of fixed length are vectorized: a row is compared in pieces of this many pixels, then the rest.
_PIECE = wp.constant(32)
# The logarithm of what is not below is what it is: infinity, or NaN.
_LARGEST = wp.constant(3.0e38)
_ERROR_SHARE = wp.constant(ERROR_SHARE)
_MAX_TRANSMITTANCE = wp.constant(1.0 - MIN_COVERAGE)
# Positions of the kernel inputs that change from step to step.
_DEPTH, _WEIGHTS, _SLOPE, _BIAS = 4, 5, 7, 8


@wp.func
def compared(
    packed: wp.uint8,  # w * 255
    transmittance: float,
    measured: float,  # [m]
    depth: float,  # [m]
    slope: float,
    bias: float,
    before: float,  # the gradient of a pixel that does not count
) -> wp.vec2:
    """Return what a pixel adds to the sum, and its gradient; without branches."""
    weight = float(packed) * (1.0 / 255.0)
    true = measured / larger(1.0 - bias * measured, 0.1)
    error = depth - true
    apart = wp.abs(error)
    scale = _ERROR_SHARE * true
    ratio = 1.0 + apart / scale
    counts = weight > 0.0 and transmittance <= _MAX_TRANSMITTANCE
    steep = slope * weight * wp.where(error < 0.0, -1.0, 1.0) / (scale + apart)
    term = weight * wp.where(ratio < _LARGEST, log_of(ratio), ratio)
    return wp.vec2(wp.where(counts, term, 0.0), wp.where(counts, steep, before))


@wp.kernel
def depth_kernel(
    row: int,
    pitch: int,
    origin: int,
    regions: wp.array2d[int],  # [2, 4] the box of the measured depth, and the part to fill
    transmittance: wp.array[float],  # 1 padded plane
    measured: wp.array[float],  # [size of the box] [m]
    weights: wp.array[wp.uint8],  # [size of the box] w * 255
    depth: wp.array[float],  # 1 padded plane [m]
    slope: float,  # weight of the term / sum w
    bias: float,  # of the measured inverse depth [1/m]
    # outputs
    adj_depth: wp.array[float],  # 1 padded plane
    sums: wp.array[float],  # [height] sum of w log(...) over a row
):
    """Compare one row and write its gradient."""
    y = row + wp.tid()
    start = origin + y * pitch
    if y >= regions[1, 1] and y < regions[1, 3]:
        fill(adj_depth, start + regions[1, 0], regions[1, 2] - regions[1, 0], 0.0)
    total = float(0.0)
    if y >= regions[0, 1] and y < regions[0, 3]:
        width = regions[0, 2] - regions[0, 0]
        terms = wp.zeros(shape=(_PIECE,), dtype=float)
        whole = width // _PIECE
        for piece in range(whole + 1):
            at = start + regions[0, 0] + piece * _PIECE
            source = (y - regions[0, 1]) * width + piece * _PIECE
            count = wp.min(_PIECE, width - piece * _PIECE)
            behind = floats_from(transmittance, at, count)
            shown = floats_from(depth, at, count)
            goal = floats_from(measured, source, count)
            packed = bytes_from(weights, source, count)
            gradient = floats_from(adj_depth, at, count)
            if count == _PIECE:
                for px in range(_PIECE):
                    of_px = compared(
                        packed[px], behind[px], goal[px], shown[px], slope, bias, gradient[px]
                    )
                    terms[px] = terms[px] + of_px[0]
                    gradient[px] = of_px[1]
            else:
                for t in range(count):
                    of_t = compared(
                        packed[t], behind[t], goal[t], shown[t], slope, bias, gradient[t]
                    )
                    terms[t] = terms[t] + of_t[0]
                    gradient[t] = of_t[1]
        for column in range(_PIECE):
            total += terms[column]
    sums[y] = total


@dataclass(frozen=True, eq=False)
class DepthTarget:
    """Measured depth inside a view's box: flat arrays on the device."""

    depth: wp.array  # [m], float32; undefined where the weight is 0
    weights: wp.array  # w * 255, uint8
    total: float  # the sum of w


def depth_weights(
    image: np.ndarray, mask: np.ndarray, depth: np.ndarray, confidence: np.ndarray | None
) -> np.ndarray:
    """Return w * 255, shape (height, width), uint8.

    Args:
        image: sRGB, (height, width, 3), uint8.
        mask: 0..255, (height, width); `OBJECT` or more on the object.
        depth: [m], NaN where unknown.
        confidence: 0..1, (height, width); None: 1 everywhere.
    """
    found = np.zeros(mask.shape, np.uint8)
    x0, y0, x1, y1 = box = mask_box(mask >= OBJECT)
    inside = (slice(y0, y1), slice(x0, x1))
    edges = _steepness(image, box)
    weights = np.exp(-edges)
    if confidence is not None:
        weights = weights * confidence[inside]
    near = depth[inside]
    weights[~(np.isfinite(near) & (near > 0) & (mask[inside] >= OBJECT))] = 0.0
    found[inside] = np.rint(255.0 * weights)
    return found


def _steepness(image: np.ndarray, box: PixelBox) -> np.ndarray:
    """Return |grad I| inside a box: mean over the channels of differences to the next pixel, in 0..1."""
    x0, y0, x1, y1 = box
    # The pixels beyond the box are neighbors, too; at the rim of the image the last one repeats.
    near = image[y0 : y1 + 1, x0 : x1 + 1].astype(np.float32) / np.float32(255.0)
    beyond = (y1 - y0 + 1 - near.shape[0], x1 - x0 + 1 - near.shape[1])
    near = np.pad(near, ((0, beyond[0]), (0, beyond[1]), (0, 0)), mode="edge")
    here = near[:-1, :-1]
    both = np.abs(near[:-1, 1:] - here), np.abs(near[1:, :-1] - here)
    across, down = ((d[..., 0] + d[..., 1] + d[..., 2]) / np.float32(3.0) for d in both)
    return np.hypot(across, down)


class DepthLoss:
    """The depth term and its gradient with respect to the expected depth.

    Args:
        depth, transmittance: the rendered planes, one each.
        adj_depth: where dL/ddepth goes, same layout.
        weight: weight of the term.

    Attributes:
        sums: the array that `value` sums, on the device.
    """

    def __init__(
        self,
        depth: ImagePlanes,
        transmittance: ImagePlanes,
        adj_depth: ImagePlanes,
        weight: float,
    ) -> None:
        device = str(depth.data.device)
        self.weight = weight
        self._scale = 0.0
        self._adj_depth = adj_depth
        self._regions = wp.zeros((2, 4), dtype=int, device=device)
        self.sums = wp.zeros(depth.max_height, dtype=float, device=device)
        empty = [wp.zeros(1, dtype=kind, device=device) for kind in (float, wp.uint8)]
        self._launch = ParallelLaunch(
            depth_kernel,
            depth.max_height,
            [depth.pitch, depth.origin, self._regions, transmittance.data, *empty]
            + [depth.data, 0.0, 0.0, adj_depth.data, self.sums],
            device,
            even=True,  # few launches: setting what changes takes longer than an idle moment of a core
        )

    def run(
        self,
        target: DepthTarget,
        box: PixelBox,
        drawn: PixelBox,
        bias: float = 0.0,
        trust: float = 1.0,
        slope_factor: float = 1.0,
    ) -> None:
        """Compute the term and its gradient.

        Args:
            target: the measured depth inside ``box``.
            box: where it lies in the image.
            drawn: the box in which the gradient is needed (where splats are).
            bias: of the measured inverse depth [1/m], to be taken off.
            trust: factor on the weight.
            slope_factor: factor on the gradient alone, for a view that is a mean of several renderings.
        """
        self._scale = trust * self.weight / target.total if target.total > 0 else 0.0
        put(self._regions, np.array([box, drawn]))
        self._launch.set_param(_DEPTH, target.depth)
        self._launch.set_param(_WEIGHTS, target.weights)
        self._launch.set_param(_SLOPE, slope_factor * self._scale)
        self._launch.set_param(_BIAS, bias)
        self._launch.run()

    def skip(self) -> None:
        """Compare nothing: the view has no depth."""
        self._scale = 0.0
        self._adj_depth.data.zero_()

    def value(self) -> float:
        """Return the weighted term of the last `run`; waits for the device."""
        return self._scale * float(self.sums.numpy().sum(dtype=np.float64))
