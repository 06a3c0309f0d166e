"""Weak texture: image noise shows in the disparity and, in the end, drowns the match.

One kernel applies noise, strips and holes in one pass over the frame. It adds up seven fields from their
rows, piece by piece, and never stores them: storing them image by image took most of the time. The same
formulas in NumPy: tests/reference/weak_texture_twin.py.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import warp as wp

from digs_warp.device.contiguous import bytes_from, floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.filters import box_mean
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.noise_field import level_above, normal_rows
from digs_warp.sim.sensor.row_field import PIECE, RowField, Rows, interpolated, sum_rows
from digs_warp.sim.sensor.tables import LogTable
from digs_warp.sim.sensor.texture import BLOCK, noise_of

wp.set_module_options(vector_module_options())

# Disparity error [px] by typical gradient / image noise: semi-global matching (window 5, image noise 2 DN) of
# rendered scenes, between a brick wall (0.75 times as much) and a blurred photograph (1.3 times). The typical
# gradient is the geometric mean over a region: a few strong edges do not help a plain surface.
SNRS = (0.05, 0.09, 0.18, 0.37, 0.75, 1.5, 3.0, 6.0)
ERRORS = (1.10, 0.85, 0.57, 0.41, 0.29, 0.22, 0.16, 0.10)

# In addition, whole strips along the rows are wrong or lost together: semi-global matching carries
# disparity from pixel to pixel. Shares of pixels by SNR that are wrong beyond such noise, and of holes, in
# the recorded images of four meshes; 70 % of all wrong pixels are too far.
STRIP_SNRS = (0.05, 0.09, 0.12, 0.18, 0.37, 0.75, 1.5, 2.2)
STRIP_WRONG = (0.30, 0.18, 0.12, 0.075, 0.05, 0.047, 0.005, 0.0)
STRIP_LOST = (0.60, 0.45, 0.05, 0.005, 0.0, 0.0, 0.0, 0.0)

# Correlation length of the strips along rows and columns [px]. The wrong pixels of the matcher are still
# correlated by 0.2 at 32 px along rows, by 0.1 along columns.
STRIP_LENGTHS = (48.0, 5.0)

# Holes need weak texture over a region of this size [px].
STRIP_SURROUNDINGS = 81

# Half of the wrong pixels are off by more than 1.4 px, one in ten by more than 2.5 px. Error at the rim of
# a strip [px], and its growth per unit of the field whose peaks are the strips.
STRIP_ERROR, STRIP_GROWTH = 1.05, 1.6

# Errors above this get a label [px].
WRONG = 1.0

# In weak texture noise is smooth over more pixels: measured 10 along rows and 5 along columns instead of 4.
CORRELATION_GAIN = (1.25, 2.5)  # columns, rows

# Size of the region that the SNR is of [windows]: semi-global matching gathers evidence beyond its window.
REGION = 4

# Share of matched pixels by SNR where the texture is weak all around.
FILL_SNRS = (0.0, 0.06, 0.12, 0.24, 0.47)
FILL = (0.0, 0.003, 0.09, 0.99, 1.0)

# "All around": a plain patch smaller than this is filled from its rim [px].
SURROUNDINGS = 161

# Mean square gradient below which there is nothing to match [DN^2/px^2].
TINY = np.float32(1e-6)

# The effect switches on if a larger share of the surface has an SNR below 0.5.
MIN_SHARE = 0.01

# The curves above over ln(SNR).
_ERROR = LogTable(SNRS, ERRORS)
_WRONG = LogTable(STRIP_SNRS, STRIP_WRONG)
_LOST = LogTable(STRIP_SNRS, STRIP_LOST)
_FILL = LogTable(FILL_SNRS, FILL)

_PIECE = wp.constant(PIECE)
_MEMORY = wp.constant(7 * PIECE)
_CAUSE = wp.constant(int(Cause.WEAK_TEXTURE))
_NOTHING = wp.constant(float("nan"))
_STRIP_ERROR, _STRIP_GROWTH = wp.constant(STRIP_ERROR), wp.constant(STRIP_GROWTH)
_WRONG_FROM = wp.constant(WRONG)


@wp.func
def is_lost(strip: float, wrong: float, lost: float, patch: float, patch_level: float) -> bool:
    """Whether a pixel has no value left."""
    return (strip > wrong and strip > lost) or patch > patch_level


@wp.func
def new_disparity(old: float, noise: float, strip: float, wrong: float) -> float:
    """What a pixel that is not lost gets."""
    return wp.where(
        strip > wrong, old - (_STRIP_ERROR + _STRIP_GROWTH * (strip - wrong)), old + noise
    )


@wp.kernel
def _weak_texture_kernel(
    first: int,
    width: int,
    noise: Rows,
    sigma: Rows,
    strips: Rows,
    wrong_level: Rows,
    lost_level: Rows,
    patches: Rows,
    patch_level: Rows,
    # inputs and outputs
    disparity: wp.array[float],  # [height * width]
    cause: wp.array[wp.uint8],  # [height * width]
    confidence: wp.array[float],  # [height * width]
):
    """Process one row."""
    row = first + wp.tid()
    memory = wp.zeros(shape=(_MEMORY,), dtype=float)
    error = wp.array(ptr=memory.ptr, shape=(_PIECE,), dtype=float)
    size = floats_from(error, _PIECE, _PIECE)
    strip = floats_from(error, 2 * _PIECE, _PIECE)
    wrong = floats_from(error, 3 * _PIECE, _PIECE)
    lost = floats_from(error, 4 * _PIECE, _PIECE)
    patch = floats_from(error, 5 * _PIECE, _PIECE)
    limit = floats_from(error, 6 * _PIECE, _PIECE)
    for piece in range((width + _PIECE - 1) // _PIECE):
        column = piece * _PIECE
        sum_rows(noise, row, column, error)
        sum_rows(sigma, row, column, size)
        sum_rows(strips, row, column, strip)
        sum_rows(wrong_level, row, column, wrong)
        sum_rows(lost_level, row, column, lost)
        sum_rows(patches, row, column, patch)
        sum_rows(patch_level, row, column, limit)
        count = wp.min(_PIECE, width - column)
        old = floats_from(disparity, row * width + column, count)
        label = bytes_from(cause, row * width + column, count)
        trust = floats_from(confidence, row * width + column, count)
        if count == _PIECE:
            for x in range(_PIECE):
                known = old[x] == old[x]
                shift = error[x] * size[x]
                gone = is_lost(strip[x], wrong[x], lost[x], patch[x], limit[x])
                fails = known and (gone or strip[x] > wrong[x] or wp.abs(shift) > _WRONG_FROM)
                value = new_disparity(old[x], shift, strip[x], wrong[x])
                old[x] = wp.where(gone, _NOTHING, value)
                label[x] = wp.where(fails, wp.uint8(_CAUSE), label[x])
                trust[x] = wp.where(fails, wp.where(gone, 0.0, 0.5), trust[x])
        else:
            for t in range(count):
                known_t = old[t] == old[t]
                shift_t = error[t] * size[t]
                gone_t = is_lost(strip[t], wrong[t], lost[t], patch[t], limit[t])
                fails_t = known_t and (
                    gone_t or strip[t] > wrong[t] or wp.abs(shift_t) > _WRONG_FROM
                )
                value_t = new_disparity(old[t], shift_t, strip[t], wrong[t])
                old[t] = wp.where(gone_t, _NOTHING, value_t)
                label[t] = wp.where(fails_t, wp.uint8(_CAUSE), label[t])
                trust[t] = wp.where(fails_t, wp.where(gone_t, 0.0, 0.5), trust[t])


@dataclass(frozen=True, eq=False)
class WeakTextureFields:
    """The fields that decide about each pixel.

    Attributes:
        noise: normal field, the shape of the error.
        sigma: its size [px].
        strips: normal field; pixels above a level fail, in strips.
        wrong_level: level above which they are wrong.
        lost_level: level above which they have no value.
        patches: normal field; pixels above a level are lost, in patches.
        patch_level: that level.
    """

    noise: RowField
    sigma: RowField
    strips: RowField
    wrong_level: RowField
    lost_level: RowField
    patches: RowField
    patch_level: RowField


def apply_weak_texture(sensed: Sensed, fields: WeakTextureFields) -> None:
    """Change a frame in place; its arrays must be contiguous and of the fields' shape."""
    height, width = sensed.disparity.shape
    rows = [field.for_kernels() for field in vars(fields).values()]
    frame = [shared(image) for image in (sensed.disparity, sensed.cause, sensed.confidence)]
    launch_rows(_weak_texture_kernel, height, [width, *rows, *frame])


@dataclass(frozen=True)
class WeakTexture:
    """More noise where the gradient is close to the image noise, holes where it is below."""

    name: ClassVar[str] = "weak-texture"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if part of the surface is weakly textured."""
        return choose_above(
            self.name,
            "weak_texture_share",
            facts.weak_texture_share,
            MIN_SHARE,
            "",
            on="parts of the surface have so little texture that image noise spoils the match",
            off="the texture stands out from the image noise everywhere",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Add noise and holes; ``strength`` is a factor on the image noise."""
        rig, shape = truth.rig, truth.depth.shape
        noise = strength * noise_of(rig.image_noise)
        snr = truth.texture.typical(REGION * rig.window) - np.float32(np.log(noise))
        surroundings = box_mean(truth.texture.energies, SURROUNDINGS // BLOCK | 1)
        # Running sums leave tiny negative means in flat regions.
        energy = np.log(np.maximum(surroundings, TINY)) - np.float32(2 * np.log(noise))
        vertical, horizontal = (gain * rig.noise_correlation for gain in CORRELATION_GAIN)
        maps = (_excess_noise(snr, rig), *_strip_levels(snr), _patch_level(energy))
        sigma, wrong, lost, patch = (interpolated(grid, BLOCK, shape) for grid in maps)
        fields = WeakTextureFields(
            noise=normal_rows(rng, shape, horizontal, vertical),
            sigma=sigma,
            strips=normal_rows(rng, shape, *STRIP_LENGTHS),
            wrong_level=wrong,
            lost_level=lost,
            patches=normal_rows(rng, shape, 2 * rig.noise_correlation),
            patch_level=patch,
        )
        changed = sensed.changeable()
        apply_weak_texture(changed, fields)
        return replace(changed, owned=sensed.owned)


def _strip_levels(snr: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the levels above which a normal field is wrong, and is lost, for ln(SNR)."""
    # Small plain patches are filled from their rims.
    wider = box_mean(snr, STRIP_SURROUNDINGS // BLOCK | 1)
    lost = _LOST.at(wider)
    wrong = lost + (1 - lost) * _WRONG.at(snr)
    return level_above(wrong), level_above(lost)


def _patch_level(energy: np.ndarray) -> np.ndarray:
    """Return the level above which a normal field is lost, for 2 ln(SNR) all around."""
    return level_above(1 - _FILL.at(np.float32(0.5) * energy))


def _excess_noise(snr: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return the error in excess of that of good texture [px], for ln(SNR), float32."""
    excess = np.square(_ERROR.at(snr))
    excess -= np.float32(rig.disparity_sigma**2 * rig.temporal_share)
    return np.sqrt(np.maximum(excess, 0, out=excess), out=excess)
