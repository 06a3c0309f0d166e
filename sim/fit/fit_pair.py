"""Fit a camera to a stereo pair with true disparity.

The full search of the two recorded images is what is measured. The simulation makes the right image from the
left one and the true disparity, adds noise to both, and matches them near the truth. The noise is what the
two recorded images show differently; static field and drift are what the errors of the full search have
beyond those of the simulation. Nothing is fitted to the share of wrong values: that is predicted.
"""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.record.progress import progress
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.fit.calibration import calibrate
from digs_warp.sim.fit.estimate import Estimate
from digs_warp.sim.fit.eye_noise import Eyes, eye_noise
from digs_warp.sim.fit.known_frame import known_frame
from digs_warp.sim.fit.known_pair import filled, right_image, without_grain
from digs_warp.sim.fit.pair_folder import Pair
from digs_warp.sim.fit.pair_scores import (
    BAD,
    RMS,
    excess_variance,
    scores,
    smooth_variance,
)
from digs_warp.sim.fit.result import (
    Comparison,
    Fit,
    Fitted,
    Series,
    geometry,
    sort_out,
    with_figures,
)
from digs_warp.sim.fit.sensing import is_gray, sense_frame
from digs_warp.sim.sensor.blame import WRONG
from digs_warp.sim.sensor.effects.static_field import unit_field
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import sense

# Image noise for the chart [DN].
LEVELS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)

WHOLE, LEFT, RIGHT = "the whole image", "the left half", "the right half"


@dataclass(frozen=True, eq=False)
class Simulations:
    """A pair and its simulations.

    Attributes:
        rig: of the pair, with the base's figures.
        pair: what was recorded.
        true: disparity [px], (height, width), NaN where it is not known.
        measured: disparity that the full search of the recorded images finds.
        guided: the same near the truth.
        tried: disparity of the simulated pair at each of LEVELS, without a static field.
    """

    rig: StereoRig
    pair: Pair
    true: np.ndarray
    measured: np.ndarray
    guided: np.ndarray
    tried: tuple[np.ndarray, ...]

    def simulate(self, rig: StereoRig) -> np.ndarray:
        """Return the disparity that the simulated camera finds on the pair."""
        return _sensed(self.pair, rig, seed=1)


def pair_rig(pair: Pair, base: StereoRig) -> StereoRig:
    """Return the base at the size of a pair, with a range that holds the whole scene."""
    depth = pair.intrinsics.fx * pair.baseline / pair.disparity
    return replace(
        base,
        intrinsics=pair.intrinsics,
        baseline=pair.baseline,
        min_depth=min(base.min_depth, 0.9 * float(np.nanmin(depth))),
        max_depth=max(base.max_depth, 2 * float(np.nanmax(depth))),
        max_disparity=np.ceil(1.1 * float(np.nanmax(pair.disparity))),
        static_field=0.0,
    )


def simulated_frame(pair: Pair, rig: StereoRig) -> FrameTruth:
    """Return the pair with a right image that is made from the left one; neither has the rig's noise.

    Without the grain of the recorded images, which would be texture that both eyes see.
    """
    left, unseen = (without_grain(image, rig.image_noise) for image in (pair.left, pair.right))
    right = right_image(left, filled(pair.disparity), unseen)
    return known_frame(left, right, pair.disparity, rig)


def _sensed(pair: Pair, rig: StereoRig, seed: int) -> np.ndarray:
    gray = is_gray(np.stack([pair.left, pair.right]))
    return sense_frame(simulated_frame(pair, rig), seed=seed, gray=gray)[1].disparity


def try_noise(pair: Pair, base: StereoRig) -> Simulations:
    """Match the recorded pair, and the simulated one with rising noise."""
    rig = pair_rig(pair, base)
    recorded = known_frame(pair.left, pair.right, pair.disparity, rig)
    tried = []
    with progress(len(LEVELS), "Simulating", "noise level") as bar:
        for level in LEVELS:
            noisy = replace(rig, image_noise=level)
            tried.append(_sensed(pair, noisy, seed=0))
            bar.update()
    measured, guided = (sense(recorded, tier).disparity for tier in ("matcher", "guided"))
    return Simulations(rig, pair, pair.disparity, measured, guided, tuple(tried))


def fit_pair(pair: Pair, base: StereoRig) -> Fit:
    """Return the figures of the camera that recorded a pair, and how well each half predicts the other."""
    tries = try_noise(pair, base)
    parts = image_parts(pair.disparity.shape)
    found = [*geometry(pair.intrinsics, pair.baseline), *fit_part(tries, parts[WHOLE])]
    figures, poor = sort_out(found, base)
    tables = {
        "The two recorded images, matched over the full range and near the truth": compare(
            tries, tries.guided, parts[WHOLE]
        ),
        "The right image simulated, fitted to the whole image": compare(
            tries, tries.simulate(with_figures(tries.rig, figures)), parts[WHOLE]
        ),
    }
    for fitted, held_out in ((LEFT, RIGHT), (RIGHT, LEFT)):
        predicted = tries.simulate(with_figures(tries.rig, fit_part(tries, parts[fitted])))
        title = f"The right image simulated, fitted to {fitted}: {held_out}, held out"
        tables[title] = compare(tries, predicted, parts[held_out])
    height, width = pair.disparity.shape
    return Fit(
        about=f"stereo pair '{pair.name}', {width} by {height} pixels, with true disparity",
        figures=figures,
        kept=_KEPT | poor,
        tables=tables,
        series=(_bad_over_noise(tries, parts[WHOLE]),),
    )


_KEPT = {
    "full_well": "one image of each eye; frames of a camera at rest tell how noise grows with the light",
    "disparity_step": "the pair was matched here, not by the camera",
    "min_depth": "the pair was matched here, not by the camera",
    "max_depth": "the pair was matched here, not by the camera",
    "max_disparity": "the pair was matched here, not by the camera",
    "exposure_time": "one image of each eye",
    "readout_time": "one image of each eye",
    "vignetting": "the scene is not lit evenly",
    "post_filter": "the pair was matched here, not by the camera",
}


def image_parts(shape: tuple[int, int]) -> dict[str, np.ndarray]:
    """Return the whole image and its halves as masks."""
    left = np.broadcast_to(np.arange(shape[1]) < shape[1] // 2, shape)
    return {WHOLE: np.ones(shape, bool), LEFT: left, RIGHT: ~left}


def fit_part(tries: Simulations, where: np.ndarray) -> list[Fitted]:
    """Return the figures that a part of the image gives."""
    pair = tries.pair
    eyes = Eyes(pair.left, pair.right, pair.disparity)
    noise = eye_noise([eyes], tries.rig.full_well, where)
    if not noise.is_known:
        raise DigsError(
            f"stereo pair '{pair.name}': too few areas that both eyes see; fit another pair"
        )
    simulated = _good_error(
        tries.simulate(replace(tries.rig, image_noise=noise.value)), tries, where
    )
    measured = _good_error(tries.measured, tries, where)
    field = _static_field(measured, simulated, tries.rig)
    calibration = calibrate([measured - simulated], [tries.true], tries.rig.intrinsics)
    drifted = (
        "drift of this unit: errors beyond those of the simulated pair, by place and disparity"
    )
    return [
        Fitted("image_noise", noise, "what the eyes see differently where there is little texture"),
        Fitted("static_field", field, "smooth errors beyond those of the simulated pair"),
        *(Fitted(name, size, drifted) for name, size in calibration.figures.items()),
        Fitted(
            "disparity_sigma",
            _law_sigma(tries, where, field),
            "RMS of the errors up to a pixel, without the static field",
        ),
    ]


def compare(tries: Simulations, simulated: np.ndarray, where: np.ndarray) -> list[Comparison]:
    """Return the statistics of the full search of the recorded pair beside those of a simulation."""
    both = [scores(disparity, tries.true, where) for disparity in (tries.measured, simulated)]
    return [Comparison(name, both[0][name], both[1][name]) for name in both[0]]


def _good_error(disparity: np.ndarray, tries: Simulations, where: np.ndarray) -> np.ndarray:
    error = np.where(where, disparity - tries.true, np.nan)
    return np.where(np.abs(error) <= WRONG, error, np.nan)


def _static_field(measured: np.ndarray, simulated: np.ndarray, rig: StereoRig) -> Estimate:
    """Return the static field that the simulation lacks [px]."""
    k = rig.intrinsics
    shrink = smooth_variance(unit_field(rig.unit, k.width, k.height)).value
    excess = excess_variance(measured, simulated)
    return Estimate(excess.value / shrink, excess.error / shrink).root()


def _law_sigma(tries: Simulations, where: np.ndarray, field: Estimate) -> Estimate:
    rms = scores(tries.measured, tries.true, where)[RMS]
    error = np.hypot(2 * rms.value * rms.error, 2 * field.value * field.error)
    return Estimate(rms.value**2 - field.value**2, float(error)).root()


def _bad_over_noise(tries: Simulations, where: np.ndarray) -> Series:
    measured = scores(tries.measured, tries.true, where)[BAD]
    return Series(
        title="Wrong values at each noise of the images",
        x_label="image noise [DN]",
        y_label=BAD,
        x=LEVELS,
        measured=[measured] * len(LEVELS),
        simulated=[scores(d, tries.true, where)[BAD] for d in tries.tried],
    )
