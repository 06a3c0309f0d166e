"""`python -m studies recordings`: how well real recordings are reconstructed, and what goes wrong.

With the poses as recorded and as estimated from the images, where a recording has both. What cannot be
reconstructed is a row without figures, and its error is logged.
"""

import logging
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from digs_warp.check.check import check_capture
from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.data.viewpoints import evenly
from digs_warp.init.config import InitConfig, chosen_strategy
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.progress import progress
from digs_warp.splat.device import DeviceGaussians
from digs_warp.study.scenes import sample_data
from digs_warp.train.adherence import adherence, load_measured_views
from digs_warp.train.config import Density, Stop, TrainConfig
from studies.pose_errors import camera_errors
from studies.real_recordings import RealRecording, convert, find_recordings
from studies.results import Result
from studies.timing import Stopwatch

_log = logging.getLogger(__name__)

ITERATIONS = 500

# Held-out views of each recording that are shown beside their photographs.
SHOWN = 2

Poses = Literal["capture", "sfm", "rgbd"]
POSES: dict[Poses, str] = {"capture": "recorded", "sfm": "estimated", "rgbd": "color and depth"}


@dataclass(frozen=True, eq=False)
class Measured:
    """What came of a recording.

    Attributes:
        recording: which one.
        results: a row for each kind of poses, without figures where it failed.
        picture: held-out photographs, each with its rendered view to the right, sRGB uint8; None where
            nothing was rendered.
    """

    recording: RealRecording
    results: tuple[Result, ...]
    picture: np.ndarray | None


def bench_recordings(names: Sequence[str] = ()) -> list[Result]:
    """Return the figures of real recordings, and what was found wrong with them.

    Args:
        names: of `RECORDINGS`; none: all that are there.

    Raises:
        DigsError: an unknown name, or no recordings.
    """
    data = sample_data()
    return rows(measure_all(find_recordings(data, names), data))


def rows(measured: Iterable[Measured]) -> list[Result]:
    """Return the rows of all recordings."""
    return [row for each in measured for row in each.results]


def measure_all(
    recordings: Sequence[RealRecording], data: Path, iterations: int = ITERATIONS
) -> Iterator[Measured]:
    """Yield what comes of each recording below ``data``, as soon as it is known."""
    with progress(len(recordings), "Measuring", "recording") as bar:
        for recording in recordings:
            yield measure(recording, data / "rgbd" / recording.name, iterations)
            bar.update()


def measure(recording: RealRecording, source: Path, iterations: int = ITERATIONS) -> Measured:
    """Convert a recording, check it, and reconstruct it with each kind of poses.

    Args:
        recording: what it is.
        source: its folder.
        iterations: training steps.
    """
    results: list[Result] = []
    picture = None
    with tempfile.TemporaryDirectory() as scratch:
        capture = convert(recording, source, Path(scratch) / "capture")
        for finding in check_capture(capture).findings:
            _log.warning("%s, %s: %s", recording.name, finding.kind, finding.what)
        for poses in _ways(recording, capture):
            values: dict[str, float] = {}
            try:
                result, values = reconstructed(capture, poses, iterations, Path(scratch))
                picture = _picture(result) if picture is None else picture
            except DigsError as error:
                _log.warning("%s, %s poses: %s", recording.name, POSES[poses], error)
            labels = {"recording": recording.name, "poses": POSES[poses], "iterations": iterations}
            results.append(Result(labels, {"frames": len(capture)} | values, "figures"))
    return Measured(recording, tuple(results), picture)


def _ways(recording: RealRecording, capture: Capture) -> list[Poses]:
    """Return the kinds of poses that a recording can have."""
    ways: list[Poses] = ["capture"] if recording.has_poses else []
    with_depth = all(frame.has(Layer.DEPTH) for frame in capture.frames)
    return [*ways, "sfm", "rgbd"] if with_depth else [*ways, "sfm"]


def reconstructed(
    capture: Capture, poses: Poses, iterations: int, folder: Path
) -> tuple[Reconstruction, dict[str, float]]:
    """Return the result with the settings that `digs-warp reconstruct` has, and its figures.

    Args:
        capture: the recording.
        poses: which kind.
        iterations: training steps.
        folder: the reconstruction is written to a folder in it, named after the kind of poses.

    Raises:
        DigsError: it fails.
    """
    strategy = chosen_strategy("auto", capture.has_depth)
    config = ReconstructConfig(
        sfm=SfmConfig(poses=poses),
        init=InitConfig(strategy=strategy),
        train=TrainConfig(stop=Stop(iterations=iterations), density=Density(strategy="fixed")),
    )
    watch = Stopwatch()
    with watch:
        result = reconstruct(capture, config, folder / f"{POSES[poses]} poses")
    return result, _figures(result, capture, poses, watch)


def _figures(
    result: Reconstruction, capture: Capture, poses: Poses, watch: Stopwatch
) -> dict[str, float]:
    assert result.frames is not None
    values: dict[str, float] = {
        "held out": len(result.frames.held_out),
        "PSNR [dB]": result.scores.mean.psnr_object,
        "exposure fitted [dB]": result.scores.mean.psnr_object_aligned,
    }
    gaussians = DeviceGaussians.from_numpy(result.gaussians, "cpu")
    depth_error = adherence(gaussians, load_measured_views(result.frames.held_out))
    if depth_error is not None:
        values["depth error [cm]"] = 1e2 * depth_error
    if poses != "capture" and capture.knows_poses and capture.metric_scale.known:
        values |= pose_error(result.frames, capture)
    return values | {
        "Gaussians": len(result.gaussians),
        "seconds": watch.seconds,
        "CPU [s]": watch.cpu_seconds,
    }


def pose_error(frames: PosedFrames, capture: Capture) -> dict[str, float]:
    """Return how far estimated cameras are from the recorded ones, after the best alignment.

    Args:
        frames: with estimated cameras; those that were not placed are missing.
        capture: with recorded poses, in metres.

    Raises:
        DigsError: fewer than three cameras, or cameras on one line.
    """
    cameras = {frame.name: frame.camera for frame, _ in frames.by_time}
    errors = camera_errors(cameras, capture.frames)
    return {
        "pose error [cm]": 1e2 * float(np.median(errors.centers_m)),
        "pose error [deg]": float(np.median(errors.rotations_deg)),
    }


def _picture(result: Reconstruction) -> np.ndarray:
    assert result.frames is not None
    rows = []
    for frame in evenly(result.frames.held_out, SHOWN):
        photograph = frame.load_image()
        rows.append(np.hstack([photograph, result.load_render(frame.name, photograph.shape)]))
    return np.vstack(rows)
