"""`python -m studies photographs`: simulated photographs without their depth, beside the sensor's.

Matching of photographs was tuned on three of the objects; the other three were kept aside.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.init.config import STRATEGIES, InitConfig, chosen_strategy
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.splat.device import DeviceGaussians
from digs_warp.study.scenes import objects, sample_data
from digs_warp.train.adherence import adherence, load_measured_views
from digs_warp.train.config import Density, Stop, TrainConfig
from studies.results import Result

TUNED_ON = ("boot_plain", "spot", "ycb_mustard_bottle")
ASIDE = ("ycb_cracker_box", "sci_fi_case", "painted_stool")
RECORDING = SimulateConfig(frames=36, width=480, height=270)
STEPS = 300


def bench_photographs(
    only: Sequence[str] = (), recording: SimulateConfig = RECORDING
) -> list[Result]:
    """Return PSNR on held-out photographs, and how far the surface that they show is from the true one.

    Args:
        only: names of objects; none: all of them.
        recording: frames and size.
    """
    names = [name for name in (*TUNED_ON, *ASIDE) if not only or name in only]
    meshes = [sample_data() / "meshes" / name / f"{name}.glb" for name in names]
    found, results = objects(len(meshes), meshes=meshes), []
    with progress(len(found), "Measuring", "recording") as bar:
        for name, settings in found.items():
            with tempfile.TemporaryDirectory() as folder:
                capture = simulate(replace(recording, **settings), Path(folder) / "capture")
                bare = tuple(frame.without_layer(Layer.DEPTH) for frame in capture.frames)
                values = _measured(replace(capture, frames=bare), "photographs", Path(folder))
                values |= _measured(capture, "sensor", Path(folder))
            k = capture.frames[0].camera.intrinsics
            labels = {"object": name, "tuned on": "yes" if name in TUNED_ON else "no"}
            labels |= {"frames": len(capture), "image": f"{k.width}x{k.height}", "steps": STEPS}
            results.append(Result(labels, values))
            bar.update()
    return results


def _measured(capture: Capture, source: str, folder: Path) -> dict[str, float]:
    strategy = chosen_strategy("auto", capture.has_depth)
    density = Density(strategy=STRATEGIES[strategy].density)
    train = TrainConfig(stop=Stop(iterations=STEPS), density=density)
    config = ReconstructConfig(init=InitConfig(strategy=strategy), train=train)
    result = reconstruct(capture, config, folder / source)
    assert result.frames is not None
    gaussians = DeviceGaussians.from_numpy(result.gaussians, "cpu")
    views = load_measured_views(result.frames.held_out, layer=Layer.DEPTH_TRUE)
    off = adherence(gaussians, views)
    assert off is not None  # it was simulated
    return {
        f"{source} [dB]": result.scores.mean.psnr_object,
        f"{source}, surface off [mm]": 1e3 * off,
    }
