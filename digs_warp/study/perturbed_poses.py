"""What poses that are nearly right cost: those of `engine.perturb`, half a degree and 5 mm off.

Every object is recorded with the default sensor, and reconstructed with its true poses, with perturbed ones
as they are, and with perturbed ones that are refined. Results are judged on views of a perfect camera on
another walk, after one rigid motion of the whole result, which refined poses leave open, and after one
similarity, for nothing but the given centers and the depth tells the scale; and on held-out photographs,
whose cameras were moved until they fit the result where the poses were refined.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.engine.perturb import perturbed_capture
from digs_warp.study.engine.placement import motion_to_truth
from digs_warp.study.engine.scores import YARDSTICK, psnr_in_place, psnr_in_scale
from digs_warp.study.pose_pixels import pose_pixels
from digs_warp.study.results import Result
from digs_warp.study.timing import Stopwatch
from digs_warp.train.config import Stop, TrainConfig

TABLE = "perturbed"
IN_PLACE, IN_SCALE, HELD_OUT = (
    "PSNR in its place [dB]",
    "PSNR in its place and scale [dB]",
    "PSNR held out [dB]",
)
LOSSES = {
    IN_PLACE: "in its place, below true poses [dB]",
    IN_SCALE: "in its place and scale, below true poses [dB]",
    HELD_OUT: "held out, below true poses [dB]",
}

# Sample meshes, and whether nothing was fitted to them.
PERTURBED_MESHES = {
    **{"ycb_mustard_bottle": False, "spot": False, "tea_set": False},
    **{"avocado": True, "boot_plain": True},
}

WAYS: dict[str, SfmConfig] = {
    "true": SfmConfig(poses="capture"),
    "perturbed": SfmConfig(poses="capture", refine_poses="off"),
    "perturbed, refined": SfmConfig(poses="capture", refine_poses="on"),
}


def measure_perturbed(mesh: str, recording: SimulateConfig, iterations: int) -> list[Result]:
    """Return a row for each kind of poses.

    Args:
        mesh: name of the sample mesh.
        recording: of it.
        iterations: training steps.
    """
    with tempfile.TemporaryDirectory() as folder:
        capture = simulate(recording, Path(folder) / "capture")
        size = {"width": recording.width, "height": recording.height}
        perfect = simulate(replace(recording, **YARDSTICK | size), Path(folder) / "yardstick")
        found = {
            name: _measured(
                capture, name != "true", perfect.frames, sfm, iterations, Path(folder) / name
            )
            for name, sfm in WAYS.items()
        }
    true = found["true"]
    aside = "yes" if PERTURBED_MESHES[mesh] else "no"
    rows = []
    for name, values in found.items():
        if values is not true:
            values |= {loss: true[name] - values[name] for name, loss in LOSSES.items()}
        labels = {"object": mesh, "poses": name, "kept aside": aside, "iterations": iterations}
        rows.append(Result(labels, values, TABLE))
    return rows


def _measured(
    capture: Capture,
    perturbed: bool,
    perfect: tuple[Frame, ...],
    sfm: SfmConfig,
    iterations: int,
    folder: Path,
) -> dict[str, float]:
    config = ReconstructConfig(sfm=sfm, train=TrainConfig(stop=Stop(iterations=iterations)))
    with Stopwatch() as watch:
        given = perturbed_capture(capture) if perturbed else capture
        result = reconstruct(given, config, folder)
    assert result.frames is not None
    errors, scale = {}, 1.0
    if perturbed:
        apart = pose_pixels(capture.frames, [frame for frame, _ in result.frames.by_time])
        scale = apart.scale
        errors = {"pose error [px]": apart.error, "scale error [%]": 100 * (scale - 1)}
    posed = result.frames.training
    to_truth = motion_to_truth(posed, capture.frames, result.gaussians)
    return {
        IN_PLACE: psnr_in_place(result.gaussians, perfect, to_truth),
        IN_SCALE: psnr_in_scale(result.gaussians, perfect, posed, capture.frames, scale),
        HELD_OUT: result.scores.mean.psnr_object,
        **errors,
        "CPU [s]": watch.cpu_seconds,
    }
