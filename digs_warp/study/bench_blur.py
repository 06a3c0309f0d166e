"""`digs-warp bench blur`: what the training gains by drawing motion blur, and what that costs.

Every object is recorded as planned, and with motion blur alone, of exposures 2, 4 and 8 times as long. Each
recording is trained without the blur, with it, and without it but with twice the steps, since drawing two
poses takes about twice the time. Results are judged on views of a perfect camera of the same size along
another walk.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.engine.scores import YARDSTICK, score_on_yardstick
from digs_warp.study.results import Result
from digs_warp.study.scenes import OBJECT_SIZE, with_meshes
from digs_warp.train.config import Stop, TrainConfig

# The first was looked at while this was written, the others were kept aside.
MESHES = ("spot", "ycb_cracker_box", "tea_set")

RECORDING = SimulateConfig(frames=28, width=320, height=180, object_size=OBJECT_SIZE)
STEPS = 300

# What is recorded: all effects that the scene calls for, or motion blur alone.
RECORDINGS: Mapping[str, dict[str, Any]] = {
    "planned": {},
    **{f"blur x{times}": {"effects": "image-blur", "strength": times} for times in (2.0, 4.0, 8.0)},
}

PIXELS, GAIN, COST = "blur [px]", "gain [dB]", "CPU, drawn / ignored"
IGNORED, DRAWN, LONGER = "ignored [dB]", "drawn [dB]", "ignored, twice the steps [dB]"


def bench_blur() -> list[Result]:
    """Return PSNR on the object by object and recording; then the medians over the objects."""
    rows = measure_objects()
    return [*rows, *medians(rows)]


def measure_objects(
    data: Path | None = None,
    meshes: Sequence[str] = MESHES,
    recording: SimulateConfig = RECORDING,
    iterations: int = STEPS,
    recordings: Sequence[str] = tuple(RECORDINGS),
) -> list[Result]:
    """Return PSNR on the object by object and recording.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        meshes: names of sample meshes.
        recording: frames and size of all recordings.
        iterations: training steps.
        recordings: names in `RECORDINGS`.
    """
    results = []
    scenes = with_meshes(recording, meshes, data, "blur")
    with progress(len(scenes) * len(recordings), "Measuring", "recording") as bar:
        for mesh, scene in scenes.items():
            with tempfile.TemporaryDirectory() as folder:
                size = {"width": scene.width, "height": scene.height}
                perfect = simulate(replace(scene, **YARDSTICK | size), Path(folder) / "yardstick")
                for name in recordings:
                    settings = replace(scene, **RECORDINGS[name])
                    capture = simulate(settings, Path(folder) / name)
                    values = _measured(capture, perfect.frames, iterations)
                    results.append(Result({"object": mesh, "recording": name}, values, "objects"))
                    bar.update()
    return results


def medians(results: Sequence[Result]) -> list[Result]:
    """Return the median over the objects of every figure, by recording."""
    groups: dict[str, list[Result]] = {}
    for result in results:
        groups.setdefault(result.labels["recording"], []).append(result)
    return [
        Result(
            {"recording": recording},
            {name: float(np.median([r.values[name] for r in group])) for name in group[0].values},
            "medians",
        )
        for recording, group in groups.items()
    ]


def _measured(capture: Capture, perfect: Sequence[Frame], iterations: int) -> dict[str, float]:
    short = TrainConfig(stop=Stop(iterations=iterations), motion_blur="off")
    ignored, cheap = _trained(capture, short)
    drawn, dear = _trained(capture, replace(short, motion_blur="on"))
    longer, _ = _trained(capture, replace(short, stop=Stop(iterations=2 * iterations)))
    qualities = [_quality(result, perfect) for result in (ignored, drawn, longer)]
    assert drawn.training.rolling_shutter is not None
    return {
        PIXELS: drawn.training.rolling_shutter.blur.blur_px or 0.0,
        **dict(zip((IGNORED, DRAWN, LONGER), qualities, strict=True)),
        GAIN: qualities[1] - qualities[0],
        COST: dear / cheap,
    }


def _trained(capture: Capture, train: TrainConfig) -> tuple[Reconstruction, float]:
    """Return the result, and the seconds of all threads: they do not depend on what else runs."""
    before = process_time()
    with tempfile.TemporaryDirectory() as folder:
        result = reconstruct(capture, ReconstructConfig(train=train), Path(folder) / "trained")
    return result, process_time() - before


def _quality(result: Reconstruction, perfect: Sequence[Frame]) -> float:
    found = score_on_yardstick(result.gaussians, perfect)["psnr_object"]
    assert found is not None  # the object is in view
    return found
