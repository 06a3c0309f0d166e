"""`digs-warp bench size`: objects in their real size, with voxels that follow the recording or do not.

Voxels of 4 mm fit an object of half a metre. They are compared with voxels of two pixels on objects of 6 cm
to 2 m, and with how it was before: every object scaled to half a metre.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.results import Result
from digs_warp.study.scenes import OBJECT_SIZE, with_meshes
from digs_warp.train.config import Stop, TrainConfig

# 6 cm to 2 m; the last two were kept aside until the default was chosen.
MESHES = ("avocado", "ycb_cracker_box", "tea_set", "flight_helmet", "sci_fi_case", "sword_plain")
KEPT_ASIDE = ("ycb_mustard_bottle", "wooden_bookshelf")

FRAMES, WIDTH, ITERATIONS = 16, 320, 200
FIXED = 0.004

# Name -> settings of the recording, and the edge of the voxels [m]; None: the default.
SETTINGS: dict[str, tuple[dict[str, Any], float | None]] = {
    "made 0.5 m, 4 mm": ({"object_size": OBJECT_SIZE}, FIXED),
    "real size, 4 mm": ({}, FIXED),
    "real size, 2 px": ({}, None),
}


def bench_size(
    data: Path | None = None,
    meshes: Sequence[str] = (*MESHES, *KEPT_ASIDE),
    recording: SimulateConfig | None = None,
    iterations: int = ITERATIONS,
) -> list[Result]:
    """Return Gaussians, seconds and quality on held-out views of every object with every setting.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        meshes: names of sample meshes.
        recording: its frames and image size; None: those of the published table.
        iterations: training steps.
    """
    recording = recording or SimulateConfig(frames=FRAMES, width=WIDTH)
    scenes = with_meshes(recording, meshes, data, "size")
    results = []
    with progress(len(scenes) * len(SETTINGS), "Measuring", "run") as bar:
        for mesh, scene in scenes.items():
            for name, (changes, voxel) in SETTINGS.items():
                results.append(_measured(mesh, name, replace(scene, **changes), voxel, iterations))
                bar.update()
    return results


def _measured(
    mesh: str, name: str, config: SimulateConfig, voxel: float | None, iterations: int
) -> Result:
    settings = ReconstructConfig(
        init=InitConfig(voxel_size=voxel), train=TrainConfig(stop=Stop(iterations=iterations))
    )
    with tempfile.TemporaryDirectory() as folder:
        capture = simulate(config, Path(folder) / "capture")
        start = process_time()  # of all threads: does not depend on what else the machine does
        result = reconstruct(capture, settings, Path(folder) / "reconstruction")
        seconds = process_time() - start
    assert result.start is not None and result.start.depth is not None
    radius = capture.about.object_radius or 0.0
    values = {
        "diameter [m]": 2 * radius,
        "voxel [mm]": 1e3 * result.start.depth.voxel_size,
        "Gaussians": len(result.gaussians),
        "CPU [s]": seconds,
        "PSNR, object [dB]": result.scores.mean.psnr_object,
    }
    return Result({"object": mesh, "setting": name, "iterations": iterations}, values)
