"""A flat wall with a texture of all scales, photographed exactly: the recording whose figures are known."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.geometry.camera import Intrinsics, pixel_centers
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.config import Tier
from digs_warp.sim.fit.known_frame import ON_IMAGES, known_frame, sense_frame
from digs_warp.sim.record.frame_maker import COLOR_SEED
from digs_warp.sim.record.recorded_facts import rig_record
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.infrared.registration import sources_of
from digs_warp.sim.sensor.tiers import depth_of

TILE = 3.0  # side of the piece of texture that the wall repeats [m]
TEXELS = 2048

# Gray levels round the middle, which never get darker or brighter than the ends.
CONTRAST, MIDDLE, DARKEST, BRIGHTEST = 40.0, 128.0, 20.0, 245.0


class Place(NamedTuple):
    """Where the wall is, seen from the left eye: on the optical axis [m], and how far it is turned off it."""

    distance: float
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0

    @property
    def axes(self) -> np.ndarray:
        """Rows: along the wall to the side, along the wall down, and its normal; in camera axes."""
        angles = [-self.yaw_deg, self.pitch_deg]
        return Rotation.from_euler("YX", angles, degrees=True).as_matrix().T


# Tilted, so that every fraction of a pixel occurs.
PLACES = (
    Place(0.7, 12, 5),
    Place(1.0, -15, -6),
    Place(1.4, 18, -8),
    Place(1.9, -20, 10),
    Place(2.5, 22, 8),
)


def record_wall(
    writer: CaptureWriter,
    rig: StereoRig,
    tier: Tier,
    places: Sequence[Place] = PLACES,
    frames: int = 6,
    seed: int = 0,
    drift: Drift = NO_DRIFT,
) -> Capture:
    """Record the wall with a camera at rest, some frames at each place; no vignetting, no projector.

    ``rig`` has the figures to be found again, ``drift`` is that of the right eye since the calibration.
    """
    for i, place in enumerate(places):
        truth = photograph(place, rig, seed, drift)
        color = _of_color_camera(place, rig, seed) if rig.has_color_camera else None
        for number in range(i * frames, (i + 1) * frames):
            frame = replace(truth, number=number)
            (left, right), sensed = sense_frame(frame, tier, seed, gray=color is not None)
            depth = depth_of(sensed, frame)
            if color is None:
                images = FrameImages(left, depth, right=right, depth_true=frame.depth)
            else:
                source = sources_of(depth, rig)  # moves depth into the image of the color camera
                images = FrameImages(
                    recorded_images(replace(color, number=number), ON_IMAGES, seed + COLOR_SEED)[0],
                    np.where(source < 0, np.float32(np.nan), depth.reshape(-1)[source]),
                    depth_true=color.depth,
                    infrared_left=left[..., 0],
                    infrared_right=right[..., 0],
                )
            writer.write_frame(number, images)
            writer.add_pose(number, np.eye(4), float(number))
    return writer.finish()


def in_memory(rig: StereoRig) -> CaptureWriter:
    """Return a writer that keeps the recording in memory."""
    return CaptureWriter(None, rig.image_intrinsics, rig_record(rig))


def _of_color_camera(place: Place, rig: StereoRig, seed: int) -> FrameTruth:
    """Return what the color camera beside an infrared pair sees, as both eyes of a rig with its noise."""
    k = rig.image_intrinsics
    own = replace(rig, intrinsics=k, image_noise=rig.color_noise)
    texture = _texture(place.distance / k.fx, seed)
    image, depth = _eye(place, k, rig.color_offset, np.eye(3), texture)
    return known_frame(image, image, own.focal_baseline / depth, own)


def photograph(place: Place, rig: StereoRig, seed: int = 0, drift: Drift = NO_DRIFT) -> FrameTruth:
    """Return images and truth of the wall at a place."""
    texture = _texture(place.distance / rig.intrinsics.fx, seed)
    k, straight = rig.intrinsics, np.eye(3)
    left, depth = _eye(place, k, 0.0, straight, texture)
    turned = drift.homography(k) if drift.moves_right_image else straight
    right, _ = _eye(place, k, rig.baseline, turned, texture)
    return known_frame(left, right, rig.focal_baseline / depth, rig, drift=drift)


def _texture(pixel: float, seed: int) -> np.ndarray:
    """Return a periodic texture (amplitude 1/f), blurred to the size of a pixel on the wall [m], float32."""
    spectrum, frequency = _spectrum(seed)
    sigma = 0.5 * pixel * TEXELS / TILE  # [texels]
    blurred = np.fft.irfft2(spectrum * np.exp(-2 * (np.pi * sigma * frequency) ** 2))
    return np.clip(MIDDLE + CONTRAST * blurred, DARKEST, BRIGHTEST).astype(np.float32)


@lru_cache(maxsize=1)  # all places have the same wall
def _spectrum(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the spectrum of the texture before any blur, of mean 0 and variance 1, and its frequencies."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(rng.standard_normal((TEXELS, TEXELS)))
    frequency = np.hypot(np.fft.fftfreq(TEXELS)[:, None], np.fft.rfftfreq(TEXELS))
    spectrum /= np.maximum(frequency, 4 / TEXELS)
    spectrum[0, 0] = 0.0
    return spectrum / np.fft.irfft2(spectrum).std(), frequency


def _eye(
    place: Place, k: Intrinsics, offset: float, turned: np.ndarray, texture: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the image of an eye ``offset`` metres to the right, and the depth of the wall there.

    ``turned`` takes the places in the image where points belong to where the eye has them, (3, 3).
    """
    side, down, normal = place.axes
    px = cv2.perspectiveTransform(pixel_centers(k.width, k.height), np.linalg.inv(turned))
    rays = np.dstack([(px - [k.cx, k.cy]) / [k.fx, k.fy], np.ones(px.shape[:2])])
    from_eye = np.array([-offset, 0.0, place.distance])
    depth = normal @ from_eye / (rays @ normal)
    along = (depth[..., None] * rays - from_eye) @ np.stack([side, down], axis=1)
    columns, rows = np.moveaxis((along * TEXELS / TILE % TEXELS).astype(np.float32), -1, 0)
    gray = cv2.remap(texture, columns, rows, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_WRAP)
    pixels = np.clip(np.rint(gray), 0, 255).astype(np.uint8)
    return np.repeat(pixels[..., None], 3, axis=2), depth
