"""Settings of structure from motion, apart from their code: the command line loads only these."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from digs_warp.checks import DigsError

# No video camera takes longer for an image [s]; a number above it was meant in milliseconds.
LONGEST_READOUT = 0.5


@dataclass(frozen=True, kw_only=True)
class SfmConfig:
    """Where camera poses and sparse points come from."""

    poses: Literal["sfm", "capture", "perturbed"] = "sfm"
    """Poses: 'sfm' estimates them from the images; 'capture' takes those of the recording and only
    triangulates points; 'perturbed' does the same after moving every camera by a random error."""

    feature_size: int = 1200
    """Longest side [px] of the image in which features are sought; larger images are reduced to it.
    Smaller is faster, and poses get less exact."""

    features: int = 2000
    """Most features per image, the largest ones first; more cost matching time."""

    double_size: bool | None = None
    """Also seek features in that image enlarged twice: finds more and smaller ones, for four times the
    time. Default: only where its longest side is at most 1000 px."""

    pairing: Literal["auto", "sequential", "exhaustive"] = "auto"
    """Which images are compared: 'sequential' with those before and after (a video) and with the ones
    that look most alike (loops); 'exhaustive' with all others, for unordered images. 'auto' is exhaustive
    up to 40 images."""

    overlap: int = 6
    """How many images before and after each one are compared; for sequential pairing."""

    loop_images: int = 3
    """How many images that look most alike are compared on top; closes loops. 0: none."""

    mapper: Literal["incremental", "global"] = "incremental"
    """How cameras are placed: one after the other, or all at once."""

    refine_focal: bool = False
    """Take the focal lengths of the recording for a guess and estimate them, too."""

    readout_time: float | None = None
    """Rolling shutter: time from the first row to the last [s]; poses that are estimated allow for it.
    Default: what the recording says of itself. 0: all rows at once."""

    min_registered: float = 0.9
    """Share of the images that have to be placed in one model; with fewer the run stops and says why.
    Lower it to go on with the largest model, with a warning."""

    rotation_error_deg: float = 0.5
    """For 'perturbed': standard deviation of the rotation about each axis [degree]."""

    translation_error: float = 0.005
    """For 'perturbed': standard deviation of the camera's position along each axis [m]."""

    sfm_seed: int = 0
    """Seed of everything random: matching, mapping, and the error of 'perturbed'."""

    def __post_init__(self) -> None:
        if self.feature_size < 32:
            raise DigsError(f"sfm.feature_size: {self.feature_size}, expected at least 32 px")
        if self.features < 50:
            raise DigsError(f"sfm.features: {self.features}, expected at least 50")
        if self.overlap < 1 or self.loop_images < 0:
            raise DigsError(
                f"sfm.overlap: {self.overlap}, sfm.loop_images: {self.loop_images}; expected at least 1 and 0"
            )
        if self.readout_time is not None and not 0 <= self.readout_time < LONGEST_READOUT:
            raise DigsError(
                f"sfm.readout_time: {self.readout_time}, expected seconds, 0 to below {LONGEST_READOUT}"
            )
        if not 0 < self.min_registered <= 1:
            raise DigsError(
                f"sfm.min_registered: {self.min_registered}, expected above 0 and at most 1"
            )
        errors = (self.rotation_error_deg, self.translation_error)
        if not np.isfinite(errors).all() or min(errors) < 0:
            raise DigsError(
                f"sfm.rotation_error_deg, sfm.translation_error: {errors}, expected finite, >= 0"
            )
        if self.sfm_seed < 0:
            raise DigsError(f"sfm.sfm_seed: {self.sfm_seed}, expected 0 or above")
