"""Fit a camera to a recording of a wall: measure, simulate the same wall, compare."""

from collections.abc import Sequence
from dataclasses import astuple, replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.record.progress import progress
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.fit.calibration import FEWEST_POSES, Bias, bias
from digs_warp.sim.fit.device_figures import WINDOWS, Roughness, correlation_of, roughness
from digs_warp.sim.fit.estimate import Estimate
from digs_warp.sim.fit.image_noise import NO_NOISE, ImageNoise, image_noise
from digs_warp.sim.fit.known_frame import known_frame, right_image, sense_frame
from digs_warp.sim.fit.result import Comparison, Fit, Fitted, geometry, sort_out, with_figures
from digs_warp.sim.fit.wall import Pose, Wall, describe, make_pose
from digs_warp.sim.fit.wall_figures import depth_range, disparity_step, noise, sigma_of, wall_holes
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.words import counted

# Frames of each pose that are simulated: enough for the split into fixed and temporal noise.
SIMULATED_FRAMES = 4

# The issue asks for 4 to 6 distances; fewer leave figures unknown.
GOOD_POSES = 4

# Origin of the figures of the drift, and why there are none.
OF_ONE_UNIT = "drift of this unit by --distances; the spread of other units is not known"
NO_TRUTH = f"needs --distances of {FEWEST_POSES} or more places"

HIDDEN = "hardly any pixel changes between frames: rounding to 8 bits hides the noise"

GRAY = (
    "the images have no color; a camera that is simulated with this profile has, and the noise on the "
    "brightness of its images is a third smaller"
)


def fit_wall(wall: Wall, base: StereoRig, distances: Sequence[float] | None = None) -> Fit:
    """Return the figures of the camera that recorded a wall.

    Args:
        wall: the recording.
        base: figures that the recording does not determine, at the size of the recording.
        distances: depth of the wall on the optical axis at each pose, from the nearest to the farthest [m];
            None: not known.

    Raises:
        DigsError: distances that do not fit the poses.
    """
    _check(wall, distances)
    own = _figures_of(wall)
    images = image_noise([pose.images for pose in wall.poses])
    biased = bias(wall, distances)
    figures = [
        *geometry(wall.intrinsics, wall.baseline),
        *_of_color_camera(wall),
        *_calibration(own["static_field"], biased.figures(wall.intrinsics.fx)),
        *_reporting(wall, base, own),
    ]
    if images.is_hidden:
        poor = {"image_noise": HIDDEN, "full_well": HIDDEN}
    else:
        figures, poor = figures + (_of_images(images) if images.is_still else []), {}
    figures, imprecise = sort_out(figures, base)
    rig = with_figures(base, figures)
    simulated = simulate_wall(wall, rig, biased.drift(wall.intrinsics.fx))
    return Fit(
        about=describe(wall),
        figures=figures,
        kept=_kept(wall, figures) | poor | imprecise,
        comparisons=_comparisons(wall, own, simulated, images, biased),
        doubts=tuple(_doubts(wall, images)),
    )


def _check(wall: Wall, distances: Sequence[float] | None) -> None:
    if distances is None:
        return
    found = ", ".join(f"{wall.distance(pose):.2f}" for pose in wall.poses)
    if len(distances) != len(wall.poses):
        raise DigsError(
            f"--distances: {counted(len(distances), 'value')}, expected {len(wall.poses)}, one for each "
            f"place of the camera (it measured {found} m); give the depth of the wall in the middle of the "
            "image, from near to far"
        )
    if list(distances) != sorted(distances):
        raise DigsError(
            f"--distances: not in rising order; give them from near to far (the recording measured {found} m)"
        )


def _calibration(static_field: Estimate, drift: dict[str, Estimate]) -> list[Fitted]:
    found = [Fitted(name, size, OF_ONE_UNIT) for name, size in drift.items()]
    if static_field.is_known:
        how = "what the errors at all distances have in common"
        found.append(Fitted("static_field", static_field, how))
    return found


def _reporting(wall: Wall, base: StereoRig, own: dict[str, Estimate]) -> list[Fitted]:
    """Return the figures of what the camera reports: steps, range, and the noise of the closed-form law."""
    step, (nearest, farthest) = disparity_step(wall), depth_range(wall)
    found = [Fitted("disparity_step", step, "all values are multiples of it")] * step.is_known
    sigma = _law_sigma(own, step)
    found.append(Fitted("disparity_sigma", sigma, "all noise but the static field"))
    correlation = correlation_of([own[f"window {size}"].value for size in WINDOWS])
    if np.isfinite(correlation):
        how = "growth of the rest to a plane with the window"
        found.append(Fitted("disparity_correlation", Estimate(correlation, np.nan), how))
    if own["temporal"].is_known and sigma.value > 0:
        found.append(
            Fitted("temporal_share", _share(own["temporal"], sigma), "temporal part of it")
        )
    missing = own["holes"]
    if missing.is_known:
        found.append(Fitted("hole_share", missing, "share without depth"))
    for name, seen, is_wider in (
        ("min_depth", nearest, nearest < base.min_depth),
        ("max_depth", farthest, farthest > base.max_depth),
    ):
        if is_wider:
            found.append(
                Fitted(name, Estimate(seen, np.nan), "reported; the end itself was not seen")
            )
    return found


def _law_sigma(own: dict[str, Estimate], step: Estimate) -> Estimate:
    """Return the noise without the static field and without the rounding to steps."""
    sigma, field = own["sigma"], own["static_field"]
    rounding = step.value**2 / 12 if step.is_known else 0.0
    field = field if field.is_known else Estimate(0.0, 0.0)
    variance = sigma.value**2 - field.value**2 - rounding
    error = np.hypot(2 * sigma.value * sigma.error, 2 * field.value * field.error)
    return Estimate(variance, float(error)).root()


def _share(part: Estimate, whole: Estimate) -> Estimate:
    """Return the share of the variance that a part of the noise has; rounding may lift it above 1."""
    share = min((part.value / whole.value) ** 2, 1.0)
    relative = np.hypot(part.error / part.value, whole.error / whole.value) if part.value else 0.0
    return Estimate(share, float(2 * share * relative))


def _of_images(images: ImageNoise) -> list[Fitted]:
    figures = []
    if images.mid_gray.is_known:
        figures.append(Fitted("image_noise", images.mid_gray, "images of the camera at rest"))
    if images.full_well.is_known:
        figures.append(Fitted("full_well", images.full_well, "growth of that noise with the light"))
    return figures


def _of_color_camera(wall: Wall) -> list[Fitted]:
    """Return place, focal length and noise of the color camera beside an infrared pair."""
    if wall.color_camera is None:
        return []
    how = "calibration of the recording"
    places = dict(zip(("color_offset", "color_zoom"), wall.color_camera, strict=True))
    found = [Fitted(name, Estimate(value, np.nan), how) for name, value in places.items()]
    images = image_noise([pose.color for pose in wall.poses if pose.color is not None])
    if images.mid_gray.is_known and images.is_still and not images.is_hidden:
        found.append(Fitted("color_noise", images.mid_gray, "color images of the camera at rest"))
    return found


def simulate_wall(wall: Wall, rig: StereoRig, drift: Drift = NO_DRIFT) -> Wall:
    """Return the same wall as the simulated camera records it.

    The mean image of each pose is the texture; the right eye sees it moved by the plane, and by what a
    ``drift`` adds to the columns.
    """
    poses = []
    with progress(len(wall.poses), "Simulating", "place") as bar:
        for number, pose in enumerate(wall.poses):
            poses.append(_simulated(pose, rig, drift, 100 * number, wall.is_gray))
            bar.update()
    return replace(wall, poses=tuple(poses))


def _simulated(pose: Pose, rig: StereoRig, drift: Drift, number: int, gray: bool) -> Pose:
    plane = pose.plane.disparity(pose.disparity.shape[1:])
    left = np.rint(pose.images.mean(axis=0)).astype(np.uint8)
    right = right_image(left, drift.shown_disparity(plane.astype(np.float32), rig.intrinsics))
    measured, images = [], []
    for i in range(min(len(pose.disparity), SIMULATED_FRAMES)):
        frame = known_frame(left, right, plane, rig, number + i, drift)
        recorded, sensed = sense_frame(frame, gray=gray)
        measured.append(np.where(pose.looked, sensed.disparity, np.float32(np.nan)))
        images.append(recorded[0])
    return make_pose("simulated wall", np.stack(measured), np.stack(images), pose.looked)


def _comparisons(
    wall: Wall, own: dict[str, Estimate], simulated: Wall, images: ImageNoise, biased: Bias
) -> list[Comparison]:
    own, other = dict(own), _figures_of(simulated)
    own["image"] = images.temporal
    other["image"] = image_noise([pose.images for pose in simulated.poses]).temporal
    # The planes of the recording are the truth of the simulation.
    places = [wall.distance(pose) for pose in wall.poses]
    for found, line in ((own, biased), (other, bias(simulated, places))):
        found["offset"], found["scale"] = line.offset, line.scale
    names = {
        "sigma": "disparity noise of a frame [px]",
        "temporal": "of that, temporal [px]",
        "fixed": "of that, fixed [px]",
        "static_field": "of that, common to all distances [px]",
        **{f"window {size}": f"rest to a plane in windows of {size} px [px]" for size in WINDOWS},
        "offset": "offset of the disparity [px]",
        "scale": "scale of the disparity",
        "wrong": "share off the wall by more than a pixel",
        "holes": "share without depth",
        "small holes": "of that, in holes of up to 3 pixels",
        "hole count": "holes in 10,000 pixels",
        "image": "noise of the images between frames [DN]",
    }
    by_distance = [
        Comparison(f"disparity noise of a frame at {place:.2f} m [px]", sigma_of(a), sigma_of(b))
        for place, a, b in zip(places, wall.poses, simulated.poses, strict=True)
    ]
    return [*(Comparison(names[name], own[name], other[name]) for name in names), *by_distance]


def _figures_of(wall: Wall) -> dict[str, Estimate]:
    return noise(wall) | wall_holes(wall) | _roughness(wall)


def _roughness(wall: Wall) -> dict[str, Estimate]:
    """Return the residual to a plane in windows of each size, over all frames and distances [px]."""
    found = {}
    for size in WINDOWS:
        parts = [roughness(pose.disparity, size) for pose in wall.poses]
        together = Roughness(
            *(np.concatenate(each) for each in zip(*map(astuple, parts), strict=True))
        )
        found[f"window {size}"] = together.estimate
    return found


def _kept(wall: Wall, figures: Sequence[Fitted]) -> dict[str, str]:
    """Return why each figure that a wall might tell is not known."""
    found = {f.name for f in figures}
    reasons = {
        "static_field": f"{counted(len(wall.poses), 'distance')}; two or more tell it from the texture",
        **dict.fromkeys(("rotation_drift", "baseline_drift"), NO_TRUTH),
        "focal_drift": "bends the depth of a wall less than its texture does",
        "disparity_step": "the values lie on no grid of 1/64 px or coarser",
        "min_depth": "no wall was nearer; take it from the data sheet",
        "max_depth": "no wall was farther; take it from the data sheet",
        "image_noise": "needs several frames of a camera at rest",
        "full_well": "image noise of a camera at rest does not grow with the light, or was not recorded",
        "max_disparity": "a wall cannot tell it from the nearest depth",
        "window": "follows from the matcher, not from its errors",
        "unit": "numbers specimens; the field itself is random",
        "exposure_time": "the camera is at rest",
        "readout_time": "the camera is at rest",
        "vignetting": "a wall is not lit evenly",
        "post_filter": "a wall has no edges",
    }
    return {name: why for name, why in reasons.items() if name not in found}


def _doubts(wall: Wall, images: ImageNoise) -> list[str]:
    doubts = []
    if wall.is_gray and wall.color_camera is None:
        doubts.append(GRAY)
    if len(wall.poses) < GOOD_POSES:
        doubts.append(f"{counted(len(wall.poses), 'distance')}; {GOOD_POSES} to 6 are better")
    if images is NO_NOISE:
        doubts.append("one frame at each distance: nothing tells what changes between frames")
    elif not images.is_still:
        doubts.append(
            f"images are {images.edges:.1f} times as noisy on edges as on plain areas: the camera moved, so "
            "their noise was not used, and the temporal part of the depth is too large"
        )
    return doubts
