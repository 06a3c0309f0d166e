"""`digs-warp bench no-depth`: starts for photographs with poses and without depth, beside one from depth.

Recordings of objects are stripped of their depth. The points of COLMAP are those of an exported workspace
that is read back; they come from the depth maps, as those of a dense model do.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time

from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import export_capture, read_recording
from digs_warp.formats.captures.to_capture import write_capture
from digs_warp.init.config import InitConfig
from digs_warp.init.strategies import STRATEGIES, StrategyName
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.results import Result
from digs_warp.study.scenes import with_meshes
from digs_warp.train.config import Density, Stop, TrainConfig

# The first was looked at while the hull was written, the second was kept aside.
MESHES = ("ycb_mustard_bottle", "tea_set")

FRAMES, WIDTH, ITERATIONS = 20, 240, 200

# What random points are as many as: those from depth.
RANDOM_POINTS = 5000

# Name -> strategy, and whether the recording brings the points of COLMAP.
STARTS: dict[str, tuple[StrategyName, bool]] = {
    "depth": ("highdepth", False),
    "hull of the masks": ("hull", False),
    "points of COLMAP": ("default", True),
    "matched points": ("default", False),
    "random": ("random", False),
}


def bench_no_depth(
    data: Path | None = None,
    meshes: Sequence[str] = MESHES,
    recording: SimulateConfig | None = None,
    iterations: int = ITERATIONS,
    starts: Sequence[str] = tuple(STARTS),
) -> list[Result]:
    """Return quality and seconds of every start on every object.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        meshes: names of sample meshes.
        recording: its frames and image size; None: those of the published table.
        iterations: training steps.
        starts: names in `STARTS`.
    """
    recording = recording or SimulateConfig(frames=FRAMES, width=WIDTH)
    scenes = with_meshes(recording, meshes, data, "no-depth")
    results = []
    with progress(len(scenes) * len(starts), "Measuring", "run") as bar:
        for mesh, scene in scenes.items():
            with tempfile.TemporaryDirectory() as folder:
                capture = simulate(scene, Path(folder) / "capture")
                for start in starts:
                    results.append(_measured(mesh, start, capture, Path(folder), iterations))
                    bar.update()
    return results


def _measured(mesh: str, start: str, capture: Capture, folder: Path, iterations: int) -> Result:
    strategy, has_points = STARTS[start]
    if has_points:
        export_capture(capture, "colmap", folder / "colmap")
        recording = read_recording(folder / "colmap", "colmap")
        capture = write_capture(recording, "colmap", folder / "back")
    elif strategy != "highdepth":
        capture = without_depth(capture)
    init = InitConfig(
        strategy=strategy, target_points=RANDOM_POINTS if strategy == "random" else None
    )
    density = Density(strategy=STRATEGIES[strategy].density)
    train = TrainConfig(stop=Stop(iterations=iterations), density=density)
    before = process_time()  # of all threads: does not depend on what else the machine does
    result = reconstruct(capture, ReconstructConfig(init=init, train=train), folder / start)
    seconds = process_time() - before
    assert result.start is not None
    values = {
        "points": len(result.start.points),
        "Gaussians": len(result.gaussians),
        "CPU [s]": seconds,
        "PSNR, object [dB]": result.scores.mean.psnr_object,
        "PSNR, frame [dB]": result.scores.mean.psnr_frame,
    }
    return Result({"object": mesh, "start": start, "iterations": iterations}, values)


def without_depth(capture: Capture) -> Capture:
    """Return a recording as a single camera without depth would have it."""
    lost = (Layer.DEPTH, Layer.DEPTH_TRUE, Layer.RIGHT, Layer.CONFIDENCE, Layer.CAUSE)
    frames = []
    for frame in capture.frames:
        for layer in lost:
            frame = frame.without_layer(layer)
        frames.append(frame)
    return replace(capture, frames=tuple(frames), rig=None)
