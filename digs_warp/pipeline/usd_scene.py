"""From a reconstruction to its USD scene, alone or in the package of its capture."""

import logging
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.measure.scores import Scores
from digs_warp.pipeline.records import Poses
from digs_warp.record.run_log import RunRecord

if TYPE_CHECKING:
    from digs_warp.data.triangle_mesh import TriangleMesh
    from digs_warp.pipeline.reconstruction import Reconstruction
    from digs_warp.usd.cameras import CameraPath
    from digs_warp.usd.convert import Precision

logger = logging.getLogger(__name__)


def write_capture_package(
    capture: Capture,
    result: "Reconstruction",
    path: Path,
    precision: "Precision" = "float",
    surface: bool = False,
) -> None:
    """Write the scene of a reconstruction of a capture, with its cameras.

    Args:
        capture: the recording.
        result: its reconstruction.
        path: the ``.usdz`` file.
        precision: see `digs_warp.usd.convert.Precision`.
        surface: also extract a mesh from the Gaussians, for the scene.

    Raises:
        DigsError: there is no surface to extract, or the scene cannot be written.
    """
    from digs_warp.pipeline.mesh import extract_mesh
    from digs_warp.usd.capture_scene import CaptureScene, write_capture_scene

    posed = result.poses.frames or PosedFrames.as_recorded(capture)
    poses = replace(result.poses, frames=posed)
    scene = CaptureScene(
        gaussians=result.gaussians,
        cameras=_camera_path(capture, posed),
        source_mesh=_source_mesh(capture, result.instance),
        surface=extract_mesh(result.gaussians, poses).mesh if surface else None,
        metadata=result.scene_metadata | _origin(capture, result.instance),
    )
    write_capture_scene(path, scene, precision)


def scene_metadata(
    gaussians: Gaussians, run: RunRecord, poses: Poses, scores: Scores
) -> dict[str, Any]:
    """Return what is known about the making of a reconstruction.

    It includes the constants of the renderer that the training used, for which USD has no attributes.
    """
    from digs_warp.splat.config import MAX_ALPHA, MIN_ALPHA
    from digs_warp.usd.metadata import filter_metadata
    from digs_warp.usd.names import OFFSET_KEY

    kernel = filter_metadata(gaussians.screen_filter)
    kernel |= {"min_alpha": MIN_ALPHA, "max_alpha": MAX_ALPHA}
    metadata: dict[str, Any] = {"kernel": kernel}
    if run.versions:
        metadata |= {"settings": run.settings, "versions": run.versions}
    if poses.metric_scale is not None:
        # A stage has to name a unit: without a scale, its metersPerUnit of 1 means nothing.
        metadata["metric_scale"] = asdict(poses.metric_scale)
    if poses.world_offset is not None:
        metadata[OFFSET_KEY] = list(poses.world_offset)
    if scores.views:
        metadata["held_out"] = scores.mean.to_json()
    return metadata


def _origin(capture: Capture, instance: int | None) -> dict[str, Any]:
    """Return the pose of the mesh file in the world."""
    world_from_mesh = capture.about.world_from_mesh
    if instance is not None:
        placed = capture.about.instance(instance)
        world_from_mesh = placed.world_from_mesh if placed and placed.mesh else None
    if world_from_mesh is None:
        return {}
    return {"world_from_mesh": [value for row in world_from_mesh for value in row]}


def _camera_path(capture: Capture, posed: PosedFrames) -> "CameraPath | None":
    """Return the cameras as the reconstruction used them, in the order of the recording."""
    from digs_warp.usd.cameras import CameraPath

    views = posed.by_time
    times = [frame.time for frame, _ in views]
    if any(later <= before for before, later in pairwise(times)):
        times = [float(i) for i in range(len(views))]  # photographs without a clock
    try:
        return CameraPath(
            cameras=tuple(frame.camera for frame, _ in views),
            times=tuple(times),
            names=tuple(frame.name for frame, _ in views),
            held_out=tuple(held_out for _, held_out in views),
            baseline=capture.right_offset,
        )
    except DigsError as error:
        logger.warning("the scene gets no cameras: %s", error)
        return None


def _source_mesh(capture: Capture, instance: int | None) -> "TriangleMesh | None":
    from digs_warp.surface.true_surface import read_true_surface

    try:
        return read_true_surface(capture.stored_in, instance) if capture.stored_in else None
    except DigsError as error:
        logger.warning("the scene gets no source mesh: %s", error)
        return None
