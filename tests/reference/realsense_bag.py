"""Writes a recording of a simulated RealSense camera by pyrealsense2 itself."""

import time
from pathlib import Path
from typing import Any

import numpy as np

WIDTH, HEIGHT, FRAMES = 64, 48, 6
METRES_PER_UNIT = 0.0005


def write_bag(rs: Any, path: Path) -> list[np.ndarray]:
    """Record color and depth of a plane 1 m away; return the color images.

    Raises:
        RuntimeError: this version cannot write such a file.
    """
    device = rs.software_device()
    sensors = [device.add_sensor(name) for name in ("Stereo", "Color")]
    sensors[0].add_read_only_option(rs.option.depth_units, METRES_PER_UNIT)
    kinds = ((rs.stream.depth, rs.format.z16, 2, 60.0), (rs.stream.color, rs.format.rgb8, 3, 50.0))
    profiles = [
        sensor.add_video_stream(_stream(rs, number + 1, *kind))
        for number, (sensor, kind) in enumerate(zip(sensors, kinds, strict=True))
    ]
    beside = rs.extrinsics()
    beside.rotation, beside.translation = [1, 0, 0, 0, 1, 0, 0, 0, 1], [0.015, 0, 0]
    profiles[0].register_extrinsics_to(profiles[1], beside)
    recorder = rs.recorder(str(path), device)
    queue = rs.frame_queue(100)
    recorded = list(recorder.query_sensors())
    for sensor in recorded:
        sensor.open(sensor.get_stream_profiles()[0])
        sensor.start(queue)
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8) for _ in range(FRAMES)]
    depth = np.full((HEIGHT, WIDTH), round(1 / METRES_PER_UNIT), np.uint16)
    for number, image in enumerate(images):
        for sensor, profile, pixels in zip(sensors, profiles, (depth, image), strict=True):
            sensor.on_video_frame(_frame(rs, profile, pixels, number))
        time.sleep(0.03)  # the recorder drops what comes faster
    for sensor in recorded:
        sensor.stop()
        sensor.close()
    return images


def _stream(rs: Any, number: int, kind: Any, form: Any, size: int, focal: float) -> Any:
    k = rs.intrinsics()
    k.width, k.height, k.fx, k.fy = WIDTH, HEIGHT, focal, focal
    k.ppx, k.ppy, k.model, k.coeffs = 31.5, 23.5, rs.distortion.none, [0.0] * 5
    stream = rs.video_stream()
    stream.type, stream.index, stream.uid, stream.fmt = kind, 0, number, form
    stream.width, stream.height, stream.fps, stream.bpp, stream.intrinsics = (
        WIDTH,
        HEIGHT,
        30,
        size,
        k,
    )
    return stream


def _frame(rs: Any, profile: Any, pixels: np.ndarray, number: int) -> Any:
    frame = rs.software_video_frame()
    frame.pixels, frame.bpp = pixels, pixels.itemsize * (3 if pixels.ndim == 3 else 1)
    frame.stride = frame.bpp * WIDTH
    frame.timestamp, frame.frame_number = 1000 + 33.0 * number, number
    frame.domain, frame.profile = (
        rs.timestamp_domain.hardware_clock,
        profile.as_video_stream_profile(),
    )
    return frame
