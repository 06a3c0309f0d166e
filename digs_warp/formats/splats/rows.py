"""What every splat file needs: axes, codes of opacities, checks for broken rows."""

import logging
import re
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, FIELDS, Gaussians, ScreenFilter
from digs_warp.geometry.rigid import far_offset, quat_multiply, quat_xyzw_from_matrix
from digs_warp.geometry.sh import MAX_DEGREE, coefficient_count, rotate_sh
from digs_warp.record.arrays import UNREADABLE

logger = logging.getLogger(__name__)

# The logit of opacity 0 and 1, which files may hold and float32 cannot compute with: at 40 the logistic
# function is 1 to the last bit of float32.
LARGEST_LOGIT = 40.0

# A standard deviation of 0 makes the covariance singular; this one is smaller than any splat [m].
SMALLEST_SCALE = 1e-12

# Half of the distance from the last step of an 8-bit opacity (0 and 255) to its neighbor's boundary:
# between the end and this far from it every value has the same code.
OPACITY_CODE_MARGIN = 0.25

# Quarter turns around x, so that positions stay exact. Our world has z up.
# x right, y up, z to the viewer (OpenGL, SPZ, USD): (x, y, z) -> (x, -z, y).
WORLD_FROM_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# x right, y down, z forward (a camera, most scenes trained from COLMAP): (x, y, z) -> (x, z, -y).
WORLD_FROM_Y_DOWN = WORLD_FROM_Y_UP.T

# Which axis of a file points up -> the rotation that brings it into our world.
WORLD_FROM_UP = {"z": np.eye(3), "y": WORLD_FROM_Y_UP, "-y": WORLD_FROM_Y_DOWN}

# Orders of the components of quaternions: PLY, SOG and .splat have wxyz.
WXYZ_FROM_XYZW = [3, 0, 1, 2]
XYZW_FROM_WXYZ = [1, 2, 3, 0]

# Comments of PLY files that say what the splats are drawn with.
_OUR_NOTE = "digs_warp screen dilation {} px^2"
_OUR_NOTE_READ = re.compile(r"digs_warp screen dilation (\d{1,2}(?:\.\d{1,9})?(?:e-\d\d?)?) px\^2")
_MODES = {
    "SplatRenderMode: default": CLASSIC,
    "SplatRenderMode: mip": ANTIALIASED,
    "antialiased 1": ANTIALIASED,
}


@contextmanager
def sound(what: str) -> Iterator[None]:
    """Raise a `DigsError` that names a file when the block finds what such a file cannot hold."""
    try:
        yield
    except DigsError:
        raise
    except (*UNREADABLE, LookupError, OverflowError, struct.error) as error:
        raise DigsError(
            f"{what}: broken or truncated ({error!r}); copy or export it again"
        ) from error


def unit_quats(quats: np.ndarray) -> np.ndarray:
    """Return quaternions xyzw, (n, 4), of length 1, float64; a zero one is no rotation."""
    quats = quats.astype(np.float64)
    norms = np.linalg.norm(quats, axis=1, keepdims=True)
    return np.where(norms == 0, (0.0, 0.0, 0.0, 1.0), quats / np.where(norms == 0, 1.0, norms))


def smallest_three(quats: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the place of the largest component of unit quaternions, (n,), and the others, (n, 3).

    The quaternions are turned over where it is negative.
    """
    which = np.abs(quats).argmax(axis=1)
    upright = quats * np.where(quats[np.arange(len(quats)), which] < 0, -1.0, 1.0)[:, None]
    return which, upright[np.arange(4) != which[:, None]].reshape(-1, 3)


def quats_from_three(which: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the quaternions of `smallest_three`, shape (n, 4), float32."""
    quats = np.empty((len(others), 4), np.float32)
    is_largest = np.arange(4) == which[:, None]
    quats[is_largest] = np.sqrt(np.maximum(0.0, 1.0 - np.einsum("ni,ni->n", others, others)))
    quats[~is_largest] = others.reshape(-1)
    return quats


def in_morton_order(gaussians: Gaussians) -> Gaussians:
    """Return Gaussians so that neighbors in space are neighbors in the file: it compresses better."""
    low, high = (end(gaussians.means, axis=0, initial=0.0) for end in (np.min, np.max))
    cells = (1023 * (gaussians.means - low) / np.where(high > low, high - low, 1.0)).astype(
        np.int64
    )
    key = np.zeros(len(cells), np.int64)
    for bit in range(10):
        for axis in range(3):
            key |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return gaussians.select(np.argsort(key, kind="stable"))


def turned(gaussians: Gaussians, b_from_a: np.ndarray) -> Gaussians:
    """Return the Gaussians of frame a in frame b, a rotation (3, 3); quaternions become unit ones.

    A zero quaternion is no rotation. Values that are not finite stay so.
    """
    quats = unit_quats(gaussians.quats)
    with np.errstate(invalid="ignore", over="ignore"):
        return replace(
            gaussians,
            means=gaussians.means @ b_from_a.T.astype(np.float32),
            quats=quat_multiply(quat_xyzw_from_matrix(b_from_a), quats),
            sh=rotate_sh(gaussians.sh, b_from_a),
            world_offset=_tuple(b_from_a @ gaussians.world_offset)
            if gaussians.world_offset is not None
            else None,
        )


def known_coefficients(count: int, what: str) -> int:
    """Return how many of ``count`` coefficients are read; above `MAX_DEGREE` none, with a warning."""
    if count > (most := coefficient_count(MAX_DEGREE)):
        logger.warning("%s: colors above degree %d are left out", what, MAX_DEGREE)
    return min(count, most)


def near_origin(
    means: np.ndarray, what: str
) -> tuple[np.ndarray, tuple[float, float, float] | None]:
    """Return centers as float32, and what had to be taken off them for it [m]; None: nothing.

    Args:
        means: shape (n, 3), as precise as the file has them.
        what: names the file in the message.
    """
    finite = means[np.isfinite(means).all(axis=1)].astype(np.float64)
    offset = far_offset(finite) if len(finite) else None
    if offset is None:
        with np.errstate(over="ignore"):  # doubles beyond float32 become infinite: a broken row
            return means.astype(np.float32), None
    cure = ""
    if means.dtype == np.float32:
        step = np.spacing(np.abs(means[np.isfinite(means)]).max())
        cure = f". It has them in steps of {step:g} m: export it with x, y and z as doubles"
    logger.warning(
        "%s: %s m are taken off its centers, which are too far from the origin for float32; kept as "
        "world_offset%s",
        *(what, offset.tolist(), cure),
    )
    return (means - offset).astype(np.float32), _tuple(offset)


def _tuple(place: np.ndarray) -> tuple[float, float, float]:
    x, y, z = place.tolist()
    return x, y, z


def nearest_known(screen_filter: ScreenFilter) -> ScreenFilter:
    """Return what other programs know that shows splats most as ``screen_filter`` does.

    Viewers that add 0.3 px^2 to a scene without a filter show it nearer to true views with antialiasing: by
    3.6 dB at half the size of the training images, 0.9 dB at it; at twice both are the same within 0.1 dB
    (`python -m studies trained`, viewers).
    """
    return CLASSIC if screen_filter == CLASSIC else ANTIALIASED


def logits_from_codes(codes: np.ndarray) -> np.ndarray:
    """Return finite opacity logits, float32, of 8-bit opacities; encoded again they give the same codes."""
    steps = np.clip(codes.astype(np.float64), OPACITY_CODE_MARGIN, 255 - OPACITY_CODE_MARGIN)
    return (np.log(steps) - np.log(255 - steps)).astype(np.float32)


def codes_from_logits(logits: np.ndarray) -> np.ndarray:
    """Return opacities as 0..255, uint8, rounded to the nearest."""
    return np.rint(255.0 / (1.0 + np.exp(-logits.astype(np.float64).clip(-700, 700)))).astype(
        np.uint8
    )


def finite_rows(gaussians: Gaussians) -> np.ndarray:
    """Return which Gaussians hold finite values only, shape (n,), bool."""
    finite = np.ones(len(gaussians), dtype=bool)
    for name in FIELDS:
        values = np.isfinite(getattr(gaussians, name))
        if not values.all():
            finite &= values.all(axis=tuple(range(1, values.ndim)))
    return finite


def without_broken_rows(gaussians: Gaussians, what: str, drop_broken: bool) -> Gaussians:
    """Return Gaussians whose values are all finite.

    Args:
        gaussians: as read.
        what: names the file in messages.
        drop_broken: leave out rows with NaN or infinite values, with a logged warning.

    Raises:
        DigsError: there are such rows, and they are not to be dropped.
    """
    finite = finite_rows(gaussians)
    if finite.all():
        return gaussians
    broken = len(gaussians) - int(np.count_nonzero(finite))
    found = f"{broken} of {len(gaussians)} Gaussians hold NaN or infinite values"
    if not drop_broken:
        raise DigsError(
            f"{what}: {found} (the first is number {np.argmin(finite)}); "
            "add --drop-broken to leave them out"
        )
    logger.warning("%s: %s; they are left out", what, found)
    return gaussians.select(finite)


def check_writable(gaussians: Gaussians, what: str) -> None:
    """Raise a `DigsError` when Gaussians hold NaN or infinite values."""
    finite = finite_rows(gaussians)
    if not finite.all():
        raise DigsError(
            f"{what}: {np.count_nonzero(~finite)} of {len(gaussians)} Gaussians hold NaN or infinite "
            f"values (the first is number {np.argmin(finite)}); nothing was written"
        )


def noted_filter(comments: Sequence[str]) -> ScreenFilter:
    """Return what the splats are drawn with, by the comments of a header."""
    modes = {mode.lower(): screen_filter for mode, screen_filter in _MODES.items()}
    found = CLASSIC
    for comment in comments:
        if ours := _OUR_NOTE_READ.fullmatch(comment):
            return ScreenFilter(float(ours[1]))
        found = modes.get(comment.lower(), found)
    return found


def notes_of(screen_filter: ScreenFilter) -> list[str]:
    """Return the comments; those of others know no other dilation than the usual one.

    For viewers that know only theirs, splats without a filter are nearer to "mip" (`nearest_known`).
    """
    nearest = nearest_known(screen_filter)
    mode = next(mode for mode, found in _MODES.items() if found == nearest)
    if screen_filter.antialias or screen_filter == nearest:
        return [mode]
    return [_OUR_NOTE.format(f"{screen_filter.dilation:g}"), mode]
