"""Two real recordings without true disparity: an infrared pair of a D435, and frames of a camera at rest."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from digs_warp.checks import require_file
from digs_warp.data.images import read_image
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.fit.depth_noise import correlation_length
from digs_warp.sim.fit.estimate import Estimate, block_numbers
from digs_warp.sim.fit.image_noise import Eyes, eye_noise, image_noise
from digs_warp.sim.fit.known_frame import (
    filled,
    known_frame,
    right_image,
    sense_frame,
)
from digs_warp.sim.fit.plane import fit_plane
from digs_warp.sim.sensor.filters import box_mean, gray_of
from digs_warp.sim.sensor.matcher import match, search_range
from digs_warp.sim.sensor.tiers import sense

# Squares on whose pixels a plane is fitted [px]; those that are full and flat count.
SQUARE, FULL, FLAT = 32, 0.9, 0.95

# Still frames of the recording with a camera at rest; later ones show it lifting off.
STILL = 5

# Side of the windows whose variance tells texture from noise [px].
GRAIN_WINDOW = 5

# Frames of a pixel that differ by more have matched something else [px].
JUMP = 1.0


@dataclass(frozen=True)
class LocalNoise:
    """Noise of disparity round local planes.

    Attributes:
        sigma: [px], with the standard error over the squares.
        correlation: distance at which its correlation has fallen to 1/e [px].
    """

    sigma: Estimate
    correlation: Estimate


def d435_pair(folder: Path) -> tuple[Estimate, dict[str, LocalNoise]]:
    """Return image noise [DN], and noise round local planes of the full search and of other sensors.

    Args:
        folder: left.png and right.png, rectified infrared images; calib.json.
    """
    left, right = (_color(folder / f"{side}.png") for side in ("left", "right"))
    calibration = json.loads(require_file(folder / "calib.json", "calibration").read_text())
    focal = calibration["fx_px"]
    k = Intrinsics(
        left.shape[1], left.shape[0], focal, focal, calibration["cx_px"], calibration["cy_px"]
    )
    rig = replace(
        load_profile("d435").rig(),
        intrinsics=k,
        baseline=calibration["baseline_m"],
        static_field=0.0,
    )
    measured = match(gray_of(left), gray_of(right), search_range(rig), rig.window)
    planes = local_planes(measured)
    scene = np.maximum(np.where(np.isfinite(planes), planes, filled(measured)), 1.0)
    where = np.isfinite(planes)
    noise = eye_noise([Eyes(left, right, np.where(where, planes, np.nan))], rig.full_well)
    rig = replace(rig, image_noise=noise.value)
    texture = without_grain(left, noise.value)
    frame = known_frame(texture, right_image(texture, scene, unseen=right), scene, rig)
    found = {
        "full search": measured,
        "recorded images": sense(known_frame(left, right, scene, rig), "guided").disparity,
        "right image simulated": sense_frame(frame, gray=True)[1].disparity,
    }
    return noise, {name: local_noise(disparity, where) for name, disparity in found.items()}


def local_planes(disparity: np.ndarray) -> np.ndarray:
    """Return the plane of every flat, full square [px], (height, width), NaN elsewhere."""
    height, width = disparity.shape
    planes = np.full((height, width), np.nan)
    for rows, columns in _squares((height, width)):
        part = disparity[rows, columns]
        found = fit_plane(part) if np.isfinite(part).mean() >= FULL else None
        if found is not None and found.share >= FLAT:
            planes[rows, columns] = found.disparity(part.shape)
    return planes


def local_noise(disparity: np.ndarray, where: np.ndarray) -> LocalNoise:
    """Return how disparity scatters round local planes in the squares ``where`` (bool) has pixels of."""
    height, width = disparity.shape
    residual = np.full((height, width), np.nan)
    for square in _squares((height, width)):
        found = fit_plane(disparity[square]) if where[square].any() else None
        if found is not None:
            residual[square] = disparity[square] - found.disparity((SQUARE, SQUARE))
    residual[np.abs(residual) > JUMP] = np.nan
    variances = [
        np.nanvar(residual[square])
        for square in _squares((height, width))
        if np.isfinite(residual[square]).mean() > FULL / 2
    ]
    error = np.std(variances, ddof=1) / np.sqrt(len(variances))
    sigma = Estimate(float(np.mean(variances)), float(error)).root()
    return LocalNoise(sigma, correlation_length(residual, block_numbers((height, width))))


def _squares(shape: tuple[int, int]) -> list[tuple[slice, slice]]:
    return [
        (slice(y, y + SQUARE), slice(x, x + SQUARE))
        for y in range(0, shape[0] - SQUARE + 1, SQUARE)
        for x in range(0, shape[1] - SQUARE + 1, SQUARE)
    ]


@dataclass(frozen=True, eq=False)
class StillFrames:
    """Rectified frames of a stereo camera at rest.

    Attributes:
        rig: with the noise of the rectified images.
        raw_noise: of the images as recorded, between frames [DN].
        left: sRGB, (frames, height, width, 3), uint8.
        right: likewise.
    """

    rig: StereoRig
    raw_noise: Estimate
    left: np.ndarray
    right: np.ndarray


@dataclass(frozen=True)
class Changes:
    """What changes between frames of a camera at rest.

    Attributes:
        images: standard deviation [DN].
        disparity: standard deviation where it jumps nowhere [px].
        typical: its median over the pixels [px].
        jumps: share of the pixels whose disparity jumps by more than a pixel.
        stays: share of the pixels with disparity in all frames.
    """

    images: Estimate
    disparity: float
    typical: float
    jumps: float
    stays: float


def still_frames(folder: Path) -> StillFrames:
    """Read and rectify the still frames of a EuRoC recording (cam0, cam1, their sensor.yaml)."""
    eyes = []
    for name in ("cam0", "cam1"):
        files = sorted((folder / name).glob("*.png"))[:STILL]
        eyes.append(np.stack([_color(path) for path in files]))
    rectified, focal, baseline = _rectified(eyes, [folder / f"cam{i}_sensor.yaml" for i in (0, 1)])
    height, width = rectified[0].shape[1:3]
    k = Intrinsics(width, height, focal, focal, width / 2, height / 2)
    noise = image_noise([rectified[0]])
    rig = replace(
        load_profile("zed2-vga").rig(),
        intrinsics=k,
        baseline=baseline,
        max_disparity=96.0,
        static_field=0.0,
        image_noise=noise.mid_gray.value,
        full_well=noise.full_well.value if noise.full_well.is_known else 4_400.0,
    )
    return StillFrames(rig, image_noise([eyes[0]]).temporal, rectified[0], rectified[1])


def recorded_changes(frames: StillFrames) -> tuple[Changes, np.ndarray]:
    """Return what changes when the recorded frames are matched, and the disparity of each frame."""
    found = np.stack(
        [
            match(gray_of(left), gray_of(right), search_range(frames.rig), frames.rig.window)
            for left, right in zip(frames.left, frames.right, strict=True)
        ]
    )
    return _changes(frames.left, found), found


def simulated_changes(frames: StillFrames, disparity: np.ndarray) -> dict[str, Changes]:
    """Return the same for other sensors, by name, from the recorded frames to a right image that is made.

    Args:
        frames: as recorded.
        disparity: of the recorded frames; its median is taken for the truth.
    """
    scene = np.maximum(filled(np.nanmedian(disparity, axis=0)), 1.0)
    left, right = (np.rint(x.mean(axis=0)).astype(np.uint8) for x in (frames.left, frames.right))
    plain = without_grain(left, frames.rig.image_noise / np.sqrt(len(frames.left)))
    pairs = zip(frames.left, frames.right, strict=True)
    recorded = [
        sense(known_frame(*pair, scene, frames.rig, number), "guided").disparity
        for number, pair in enumerate(pairs)
    ]
    return {
        "recorded frames": _changes(frames.left, np.stack(recorded)),
        "noise on their mean": _with_noise(frames, left, right, scene),
        "right image simulated": _with_noise(
            frames, plain, right_image(plain, scene, unseen=right), scene
        ),
    }


def _with_noise(
    frames: StillFrames, left: np.ndarray, right: np.ndarray, scene: np.ndarray
) -> Changes:
    images, found = [], []
    for number in range(len(frames.left)):
        frame = known_frame(left, right, scene, frames.rig, number)
        recorded, sensed = sense_frame(frame, gray=True)
        images.append(recorded[0])
        found.append(sensed.disparity)
    return _changes(np.stack(images), np.stack(found))


def _changes(images: np.ndarray, disparity: np.ndarray) -> Changes:
    known = np.isfinite(disparity).all(axis=0)
    values = disparity[:, known]
    jumps = np.ptp(values, axis=0) > JUMP
    variances = values[:, ~jumps].var(axis=0, ddof=1)
    return Changes(
        images=image_noise([images]).temporal,
        disparity=float(np.sqrt(variances.mean())),
        typical=float(np.sqrt(np.median(variances))),
        jumps=float(jumps.mean()),
        stays=float(known.mean()),
    )


def _rectified(
    eyes: list[np.ndarray], calibrations: list[Path]
) -> tuple[list[np.ndarray], float, float]:
    """Return the images of both eyes with aligned rows, their focal length [px] and baseline [m]."""
    import cv2

    (k0, d0, body0), (k1, d1, body1) = (_calibration(path) for path in calibrations)
    size = (eyes[0].shape[2], eyes[0].shape[1])
    second_from_first = np.linalg.inv(body1) @ body0
    turn0, turn1, p0, p1, *_ = cv2.stereoRectify(
        k0, d0, k1, d1, size, second_from_first[:3, :3], second_from_first[:3, 3:], alpha=0
    )
    images = []
    for stack, k, d, turn, p in zip(
        eyes, (k0, k1), (d0, d1), (turn0, turn1), (p0, p1), strict=True
    ):
        maps = cv2.initUndistortRectifyMap(k, d, turn, p, size, cv2.CV_32FC1)
        images.append(np.stack([cv2.remap(image, *maps, cv2.INTER_LANCZOS4) for image in stack]))
    return images, float(p0[0, 0]), float(-p1[0, 3] / p1[0, 0])


def _calibration(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return camera matrix, distortion, and camera-to-body transform of a EuRoC sensor.yaml."""
    import cv2

    storage = cv2.FileStorage(str(require_file(path, "calibration")), cv2.FILE_STORAGE_READ)

    def numbers(node: cv2.FileNode) -> np.ndarray:
        return np.array([node.at(i).real() for i in range(node.size())])

    fu, fv, cu, cv = numbers(storage.getNode("intrinsics"))
    distortion = numbers(storage.getNode("distortion_coefficients"))
    body_from_camera = numbers(storage.getNode("T_BS").getNode("data")).reshape(4, 4)
    return np.array([[fu, 0, cu], [0, fv, cv], [0, 0, 1]]), distortion, body_from_camera


def _color(path: Path) -> np.ndarray:
    pixels = read_image(path)
    return np.ascontiguousarray(np.repeat(pixels[..., :1], 3, axis=2))


def without_grain(image: np.ndarray, sigma: float) -> np.ndarray:
    """Return an image without noise of a known size, as far as that can be told from texture.

    Wiener's filter with the mean and the variance of small windows (Lee 1980): where these vary no more than
    the noise does, the mean is left.

    Args:
        image: sRGB, (height, width, 3), uint8.
        sigma: standard deviation of the noise of each channel [DN].
    """
    if sigma == 0:
        return image
    pixels = image.astype(np.float32)
    mean = box_mean(pixels, GRAIN_WINDOW)
    variance = np.maximum(box_mean(pixels**2, GRAIN_WINDOW) - mean**2, 1e-6)
    texture = np.maximum(variance - np.float32(sigma**2), 0) / variance
    return np.clip(np.rint(mean + texture * (pixels - mean)), 0, 255).astype(np.uint8)
