"""Attributes each missing or wrong pixel of a match to its cause, from the truth, a row at a time.

The same with NumPy, a claim after the other: tests/reference/blame_twin.py.
"""

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.parallel import launch_parallel, packed
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.arrays import shared
from digs_warp.sim.sensor.drift import NO_DRIFT
from digs_warp.sim.sensor.facts import DARK, SATURATED, STEP
from digs_warp.sim.sensor.frame import (
    MATCHABLE_SNR,
    Cause,
    FrameTruth,
    is_glossy,
    is_mirror,
    is_transparent,
    noise_of,
)
from digs_warp.sim.sensor.steps import near_steps

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false


start_warp()
wp.set_module_options(vector_module_options())

# Matches with larger errors are wrong, not just noisy [px] ("bad-1" of the Middlebury benchmark).
WRONG = 1.0

# What is known of a pixel before its label, one bit each.
_MISALIGNED, _DRIFTED, _GLOSSY, _TRANSPARENT, _MIRROR = 1, 2, 4, 8, 16
_KINDS = ((_GLOSSY, is_glossy), (_TRANSPARENT, is_transparent), (_MIRROR, is_mirror))

# Plain C: LLVM makes vector code of its loops.
_ROW = r"""
const int first = row * width;
const float* found = disparity.data + first;
const float* truth = true_disparity.data + first;
unsigned char* out = cause.data + first;

// The texture of the window: squares of twice the gradient, summed along columns, then along the row.
int* columns = scratch.data + first_scratch;
int* texture = columns + width + 2 * reach;
for (int x = 0; x < width + 2 * reach; ++x)
    columns[x] = 0;
for (int near = row - reach; near <= row + reach; ++near) {
    const int inside = near < 0 ? 0 : near > height - 1 ? height - 1 : near;
    const unsigned char* line = gray.data + inside * width;
    // The image is mirrored at its borders, where there is no gradient then; what is outside repeats that.
    for (int x = 1; x < width - 1; ++x) {
        const int twice = line[x + 1] - line[x - 1];
        columns[x + reach] += twice * twice;
    }
}
for (int x = 0; x < width; ++x)
    texture[x] = columns[x];
for (int i = 1; i <= 2 * reach; ++i)
    for (int x = 0; x < width; ++x)
        texture[x] += columns[x + i];

// What else is known of each pixel.
for (int x = 0; x < width; ++x)
    out[x] = 0;
if (has_drift)
    for (int x = 0; x < width; ++x) {
        const double disparity = truth[x], px = x + 0.5 - disparity, py = row + 0.5;
        const double scale = h[6] * px + (h[7] * py + h[8]);
        const double across = (h[0] * px + (h[1] * py + h[2])) / scale - px;
        const double down = (h[3] * px + (h[4] * py + h[5])) / scale - py;
        const double expected = (disparity - across) * h[9];
        out[x] = (__builtin_fabs(down) > WRONG ? MISALIGNED : 0)
            | (__builtin_fabs(found[x] - expected) <= WRONG ? DRIFTED : 0);
    }
if (has_kinds)
    for (int x = 0; x < width; ++x) {
        const int id = ids.data[first + x];
        const bool is_surface = __builtin_fabsf(depth.data[first + x]) < __builtin_inff();
        out[x] |= id >= 0 && is_surface ? kinds.data[id] : 0;
    }

// From the weakest to the strongest claim.
for (int x = 0; x < width; ++x) {
    const float here = truth[x], z = depth.data[first + x];
    const int known = out[x], light = gray.data[first + x];
    const bool failed = !(__builtin_fabsf(found[x] - here) <= (float)WRONG) && here == here;
    int label = known & MISALIGNED ? RECTIFICATION : RANDOM;
    label = texture[x] < least_texture ? WEAK_TEXTURE : label;
    label = step.data[first + x] ? EDGE : label;
    label = known & GLOSSY ? SPECULAR : label;
    label = light > SATURATED || light < DARK ? EXPOSURE : label;
    label = known & TRANSPARENT_BIT ? TRANSPARENT : label;
    label = known & MIRROR_BIT ? MIRROR : label;
    int strong = here > x + 0.5f ? BAND : OK;
    strong = known & DRIFTED ? RECTIFICATION : strong;
    strong = z > max_depth ? FAR : strong;
    strong = here > largest_disparity ? NEAR : strong;
    label = strong ? strong : label;
    out[x] = failed ? label : OK;
    open.data[first + x] = failed && !strong;
}
"""
_LABELS = ", ".join(f"{cause.name} = {int(cause)}" for cause in Cause)
_CONSTANTS = f"""
constexpr int {_LABELS}, SATURATED = {SATURATED}, DARK = {DARK};
constexpr int MISALIGNED = {_MISALIGNED}, DRIFTED = {_DRIFTED}, GLOSSY = {_GLOSSY};
constexpr int TRANSPARENT_BIT = {_TRANSPARENT}, MIRROR_BIT = {_MIRROR};
constexpr double WRONG = {WRONG};
"""


@wp.func_native(_CONSTANTS + _ROW)
def label_row(
    disparity: wp.array[float],
    true_disparity: wp.array[float],
    depth: wp.array[float],
    gray: wp.array[wp.uint8],
    step: wp.array[wp.uint8],
    ids: wp.array[int],
    kinds: wp.array[wp.uint8],
    h: wp.array[wp.float64],
    scratch: wp.array[int],
    cause: wp.array[wp.uint8],
    open: wp.array[wp.uint8],
    first_scratch: int,
    row: int,
    width: int,
    height: int,
    reach: int,
    least_texture: int,
    largest_disparity: float,
    max_depth: float,
    has_drift: bool,
    has_kinds: bool,
):
    """Write the labels of a row, and where an occlusion would be the stronger claim."""
    ...


@wp.struct
class Images:
    """What the claims look at; all (height * width,) unless said otherwise."""

    disparity: wp.array[float]  # as reported [px]
    true_disparity: wp.array[float]
    depth: wp.array[float]  # [m]
    gray: wp.array[wp.uint8]
    step: wp.array[wp.uint8]  # 1 near a depth step
    ids: wp.array[int]  # of materials
    kinds: wp.array[wp.uint8]  # [materials] bits
    h: wp.array[wp.float64]  # [10] homography of the drift, and the factor of its baseline
    scratch: wp.array[int]  # [height, 2, width + 2 reach]


@wp.kernel
def claims_kernel(
    first: int,
    images: Images,
    width: int,
    height: int,
    reach: int,  # of the window to either side
    least_texture: int,  # sum over the window below which there is too little to match
    largest_disparity: float,
    max_depth: float,
    has_drift: bool,
    has_kinds: bool,
    # outputs
    cause: wp.array[wp.uint8],
    open: wp.array[wp.uint8],
):
    """Process one row. The rows of a launch share the scratch memory of the first one."""
    # fmt: off
    label_row(images.disparity, images.true_disparity, images.depth, images.gray, images.step, images.ids,
              images.kinds, images.h, images.scratch, cause, open, first * 2 * (width + 2 * reach),
              first + wp.tid(), width, height, reach, least_texture, largest_disparity, max_depth,
              has_drift, has_kinds)
    # fmt: on


def strongest_claims(disparity: np.ndarray, truth: FrameTruth) -> tuple[np.ndarray, np.ndarray]:
    """Return the `Cause` of each missing or wrong pixel if nothing is hidden, and where hiding would win.

    Both (height, width), uint8 and bool; see `digs_warp.sim.sensor.attribute_errors`.
    """
    rig, drift, reach = truth.rig, truth.drift, truth.rig.window // 2
    height, width = truth.depth.shape
    kinds = [sum(bit for bit, test in _KINDS if test(material)) for material in truth.materials]
    figures = np.array([*drift.homography(rig.intrinsics).reshape(-1), drift.baseline_factor])
    near = near_steps(truth.disparity, STEP, reach + 1)
    images = packed(
        Images,
        disparity=shared(np.asarray(disparity, np.float32)),
        true_disparity=shared(truth.disparity),
        depth=shared(np.asarray(truth.depth, np.float32)),
        gray=shared(truth.gray),
        step=shared(near.view(np.uint8)),
        ids=shared(np.asarray(truth.material_ids, np.int32)),
        kinds=shared(np.array(kinds, np.uint8)),
        h=shared(figures),
        scratch=wp.empty(height * 2 * (width + 2 * reach), dtype=int, device="cpu"),
    )
    cause, is_open = (np.empty((height, width), np.uint8) for _ in range(2))
    # Of twice the gradients: 4 times the mean square, times the pixels of the window.
    least = 4 * rig.window**2 * (MATCHABLE_SNR * noise_of(rig.image_noise)) ** 2
    limits = (int(np.ceil(least)), rig.largest_disparity, rig.max_depth)
    has_any = (drift != NO_DRIFT, any(kinds))
    inputs = [images, width, height, reach, *limits, *has_any, shared(cause), shared(is_open)]
    launch_parallel(claims_kernel, height, inputs)
    return cause, is_open.view(bool)


def attribute_errors(disparity: np.ndarray, truth: FrameTruth) -> np.ndarray:
    """Return the most likely `Cause` of each missing or wrong pixel, (height, width), uint8.

    Where several causes apply, the first of these wins: range, a match that is wrong only by the drifted
    calibration, band, occlusion, mirror, glass, exposure, gloss, edge, weak texture, misaligned rows. Where
    none applies, the cause is random.

    Args:
        disparity: as the camera reports it [px], (height, width), NaN where it found nothing.
        truth: of the frame.
    """
    cause, is_open = strongest_claims(disparity, truth)
    # Rays are cast only where the answer would count.
    cause[truth.hidden_among(is_open)] = Cause.OCCLUDED
    return cause
