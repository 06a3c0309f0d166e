"""A flat wall with a texture of all scales, photographed exactly: the recording whose figures are known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.progress import progress
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.config import Tier
from digs_warp.sim.fit.known_frame import ON_IMAGES, known_frame, sense_frame
from digs_warp.sim.record.frame_maker import COLOR_SEED
from digs_warp.sim.record.recorded_facts import rig_record
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.filters import sampled
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.infrared.pair import one_channel
from digs_warp.sim.sensor.infrared.registration import sources_of
from digs_warp.sim.sensor.tiers import depth_of

TILE = 3.0  # side of the piece of texture that the wall repeats [m]
TEXELS = 2048
MARGIN = 4  # [texels]

# Gray levels round the middle, which never get darker or brighter than the ends.
CONTRAST, MIDDLE, DARKEST, BRIGHTEST = 40.0, 128.0, 20.0, 245.0


@dataclass(frozen=True)
class Place:
    """Where the wall is, seen from the left eye.

    Attributes:
        distance: on the optical axis [m].
        yaw_deg, pitch_deg: how far its normal is turned off the axis, to the side and up.
    """

    distance: float
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0

    @property
    def axes(self) -> np.ndarray:
        """Rows: along the wall to the side, along the wall down, and its normal; in camera axes."""
        yaw, pitch = np.deg2rad([self.yaw_deg, self.pitch_deg])
        turn = np.array([[np.cos(yaw), 0, -np.sin(yaw)], [0, 1, 0], [np.sin(yaw), 0, np.cos(yaw)]])
        lean = np.array(
            [[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]]
        )
        return (turn @ lean).T


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
    """Record the wall with a camera at rest at each place; no vignetting, no projector.

    Args:
        writer: as `in_memory` makes it for the rig.
        rig: the camera, with the figures to be found again.
        tier: of the sensor.
        places: one after another.
        frames: at each place.
        seed: of texture and noise.
        drift: of the right eye since the calibration.
    """
    with progress(len(places) * frames, "Recording", "frame") as bar:
        for i, place in enumerate(places):
            truth = photograph(place, rig, seed, drift)
            color = _of_color_camera(place, rig, seed) if rig.has_color_camera else None
            for number in range(i * frames, (i + 1) * frames):
                frame = replace(truth, number=number)
                recorded, sensed = sense_frame(frame, tier, seed, gray=color is not None)
                depth = depth_of(sensed, frame)
                if color is None:
                    images = FrameImages(
                        image=recorded[0],
                        right=recorded[1],
                        depth=depth,
                        depth_true=frame.depth,
                    )
                else:
                    images = _registered(recorded, depth, replace(color, number=number), rig, seed)
                writer.write_frame(number, images)
                writer.add_pose(number, np.eye(4), float(number))
                bar.update()
    return writer.finish()


def in_memory(rig: StereoRig) -> CaptureWriter:
    """Return a writer that keeps the recording in memory."""
    return CaptureWriter(None, rig.image_intrinsics, rig_record(rig))


def _of_color_camera(place: Place, rig: StereoRig, seed: int) -> FrameTruth:
    """Return what the color camera beside an infrared pair sees, as both eyes of a rig with its noise."""
    k = rig.image_intrinsics
    own = replace(rig, intrinsics=k, image_noise=rig.color_noise)
    image, depth = _eye(
        place, k, rig.color_offset, np.eye(3), _texture(place.distance / k.fx, seed)
    )
    return known_frame(image, image, own.focal_baseline / depth, own)


def _registered(
    infrared: tuple[np.ndarray, np.ndarray],
    depth: np.ndarray,
    color: FrameTruth,
    rig: StereoRig,
    seed: int,
) -> FrameImages:
    """Return a frame of the color camera, with the depth of the infrared pair moved into its image."""
    source = sources_of(depth, rig)
    left, right = map(one_channel, infrared)
    return FrameImages(
        image=recorded_images(color, ON_IMAGES, seed + COLOR_SEED)[0],
        depth=np.where(source < 0, np.float32(np.nan), depth.reshape(-1)[source]),
        depth_true=color.depth,
        infrared_left=left,
        infrared_right=right,
    )


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
    rows, columns = np.indices((k.height, k.width)) + 0.5
    belongs = np.linalg.inv(turned) @ np.stack([columns, rows, np.ones_like(rows)]).reshape(3, -1)
    u, v = (belongs[:2] / belongs[2]).reshape(2, k.height, k.width)
    x, y = (u - k.cx) / k.fx, (v - k.cy) / k.fy
    eye, center = np.array([offset, 0.0, 0.0]), np.array([0.0, 0.0, place.distance])
    depth = normal @ (center - eye) / (normal[0] * x + normal[1] * y + normal[2])
    from_center = [depth * x + offset, depth * y, depth - place.distance]
    along = [sum(a * p for a, p in zip(axis, from_center, strict=True)) for axis in (side, down)]
    columns, rows = ((np.asarray(p) * TEXELS / TILE % TEXELS).astype(np.float32) for p in along)
    # Repeated beyond its edges as far as interpolation needs it.
    gray = sampled(np.pad(texture, MARGIN, mode="wrap"), columns + MARGIN, rows + MARGIN)
    pixels = np.clip(np.rint(gray), 0, 255).astype(np.uint8)
    return np.repeat(pixels[..., None], 3, axis=2), depth
