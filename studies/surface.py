"""`python -m studies surface`: how far the trained surface is from the true one, beside fused sensed depth.

Every object is recorded with each sensor. The measured depth is fused to a mesh without training (TSDF), and
Gaussians are trained with several weights of the depth and turned into meshes in the same way. So one run
shows what the training adds to the measured geometry, and what that costs in images.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.measure.surface_metrics import surface_score
from digs_warp.pipeline.mesh import extract_mesh
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.progress import progress
from digs_warp.show.film.camera_path import find_subject
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.engine.case import STUDIED_CAMERA
from digs_warp.study.scenes import SEE_SAMPLE_DATA, objects, sample_data
from digs_warp.surface.depth_views import DepthView
from digs_warp.surface.extract import BALL_MARGIN, remove_floaters, within_mask
from digs_warp.surface.fuse import fuse_views
from digs_warp.surface.true_surface import read_true_surface
from digs_warp.train.config import DEPTH_WEIGHT, Stop, TrainConfig
from studies.results import Result

# What users get without a flag, but for the camera: smaller images and fewer steps leave the surface
# farther off.
RECORDING = SimulateConfig(profile=STUDIED_CAMERA)
STEPS = Stop().iterations
OBJECTS = 6
# Exact depth with the noise of stereo alone, and a matcher's, of a bare matcher; and the default camera.
TIERS = ("law", "guided", "d435")
CAMERAS = {"d435": {"tier": "guided", "profile": "d435"}}
WEIGHTS = (0.0, DEPTH_WEIGHT)

# The voxels of all meshes [m]; the share of points within this distance is not shown.
MESH_VOXEL = 0.003
_NEAR = 0.005

FUSED = "fused depth"
MILLIMETERS = "mesh to truth [mm]"
RATIO = "times fused depth"

# The table with a row for each object; the other one has the medians over them.
OF_OBJECTS = "objects"


@dataclass(frozen=True)
class Scope:
    """How much is measured.

    Attributes:
        objects: how many of the studies' objects.
        tiers: sensors.
        weights: of the depth; the first is what the others are compared with.
        recording: frames and size.
        iterations: training steps.
    """

    objects: int = OBJECTS
    tiers: Sequence[str] = TIERS
    weights: Sequence[float] = WEIGHTS
    recording: SimulateConfig = RECORDING
    iterations: int = STEPS


def bench_surface(only: Sequence[str] = (), scope: Scope | None = None) -> list[Result]:
    """Return PSNR and distances to the true surface by object, sensor and weight; then their medians.

    Args:
        only: names of objects; none: all of them.
        scope: how much is measured; None: the published table.

    Raises:
        DigsError: the mesh of one of ``only`` is not there.
    """
    scope = scope or Scope()
    found = objects(scope.objects)
    if missing := [name for name in only if name not in found]:
        raise DigsError(
            f"surface: no object '{missing[0]}' in '{sample_data()}'; {SEE_SAMPLE_DATA}"
        )
    found = {name: settings for name, settings in found.items() if not only or name in only}
    results = []
    with progress(len(found) * len(scope.tiers), "Measuring", "recording") as bar:
        for tier in scope.tiers:
            for name, settings in found.items():
                camera = CAMERAS.get(tier, {"tier": tier})
                config = replace(scope.recording, **camera, **settings)
                with tempfile.TemporaryDirectory() as folder:
                    capture = simulate(config, Path(folder) / "capture")
                    labels = _settings(capture, scope) | {"sensor": tier, "object": name}
                    results += _measured(labels, capture, scope)
                bar.update()
    return with_medians(results)


def with_medians(results: Sequence[Result]) -> list[Result]:
    """Return the rows of all objects by sensor, and the medians over these."""
    sensors = list(dict.fromkeys(row.labels["sensor"] for row in results))
    by_sensor = sorted(results, key=lambda row: sensors.index(row.labels["sensor"]))
    return [*by_sensor, *_medians(by_sensor)]


def measure_capture(
    capture: Capture, weights: Sequence[float], iterations: int
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the figures of the fused depth, and of the training with every weight.

    Args:
        capture: a simulated one, whose mesh is still there.
        weights: of the depth.
        iterations: training steps.
    """
    truth = read_true_surface(capture.folder)
    assert truth is not None  # it was simulated
    for number, weight in enumerate(weights):
        result = _trained(capture, weight, iterations)
        if number == 0:
            yield FUSED, {MILLIMETERS: _millimeters(fused_depth(result), truth)}
        mesh = extract_mesh(result.gaussians, result.poses, MESH_VOXEL).mesh
        values = {
            MILLIMETERS: _millimeters(mesh, truth),
            "PSNR, object [dB]": result.scores.mean.psnr_object,
            "adherence [mm]": 1e3 * (result.training.adherence or 0.0),
        }
        yield f"weight {weight:g}", values


def fused_depth(result: Reconstruction) -> TriangleMesh:
    """Return the mesh of the sensed depth of a reconstruction's frames, as `digs-warp mesh` would fuse it."""
    assert result.frames is not None
    subject = find_subject(result.gaussians)
    frames = (*result.frames.training, *result.frames.held_out)
    radius = BALL_MARGIN * subject.radius
    views = map(_sensed, frames)
    return remove_floaters(fuse_views(views, MESH_VOXEL, subject.center_world, radius)).mesh


def _sensed(frame: Frame) -> DepthView:
    color = frame.load_image().astype(np.float32) / 255.0
    return within_mask(DepthView(frame.camera, color, frame.load_depth()), frame.load_mask())


def _trained(capture: Capture, weight: float, iterations: int) -> Reconstruction:
    train = TrainConfig(stop=Stop(iterations=iterations), depth_weight=weight)
    config = ReconstructConfig(train=train)
    with tempfile.TemporaryDirectory() as folder:
        return reconstruct(capture, config, Path(folder) / "reconstruction")


def _millimeters(mesh: TriangleMesh, truth: TriangleMesh) -> float:
    return 1e3 * surface_score(mesh.points_world, truth, _NEAR).accuracy


def _settings(capture: Capture, scope: Scope) -> dict[str, Any]:
    k = capture.frames[0].camera.intrinsics
    size = f"{k.width}x{k.height}"
    return {"image": size, "frames": len(capture), "iterations": scope.iterations}


def _measured(labels: dict[str, Any], capture: Capture, scope: Scope) -> list[Result]:
    """Return a row for the fused depth and one for each weight, with ratios to the former."""
    rows = []
    fused = 0.0
    for surface, values in measure_capture(capture, scope.weights, scope.iterations):
        fused = fused or values[MILLIMETERS]
        values = values | {RATIO: values[MILLIMETERS] / fused}
        rows.append(Result({**labels, "surface": surface}, values, OF_OBJECTS))
    return rows


def _medians(results: Sequence[Result]) -> list[Result]:
    """Return the median over the objects of every figure, by sensor and surface."""
    groups: dict[tuple[str, str], list[Result]] = {}
    for result in results:
        groups.setdefault((result.labels["sensor"], result.labels["surface"]), []).append(result)
    return [
        Result(
            {name: value for name, value in group[0].labels.items() if name != "object"},
            {name: float(np.median([r.values[name] for r in group])) for name in group[0].values},
            "medians",
        )
        for group in groups.values()
    ]
