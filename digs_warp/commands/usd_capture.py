"""From folders that the commands wrote to the USD package of a capture."""

import hashlib
import logging
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.checks import DigsError
from digs_warp.commands.quality import read_quality
from digs_warp.data.capture import Capture, Frame, read_capture
from digs_warp.record.files import read_json
from digs_warp.record.layout import EVALUATION, GAUSSIANS, INITIAL_POINTS, RUN_RECORD

if TYPE_CHECKING:
    from digs_warp.data.triangle_mesh import TriangleMesh
    from digs_warp.usd.cameras import CameraPath
    from digs_warp.usd.capture_scene import SceneVariant
    from digs_warp.usd.writer import WriteOptions

logger = logging.getLogger(__name__)


def write_capture_package(
    capture_folder: Path,
    reconstructions: Sequence[Path],
    path: Path,
    options: "WriteOptions",
    surface: bool = False,
) -> int:
    """Write one scene of all reconstructions of a capture, with its cameras; return the number of splats.

    Args:
        capture_folder: the recording.
        reconstructions: folders of 'digs-warp reconstruct'; the first is shown by default, and the course of
            its training goes along where it was kept.
        path: the ``.usdz`` file.
        options: precision and degree.
        surface: also extract a mesh from the first reconstruction, for the scene.

    Raises:
        DigsError: a folder is not finished, there is no surface to extract, or the scene cannot be written.
    """
    from digs_warp.train.snapshots import load_snapshots
    from digs_warp.usd.capture_scene import CaptureScene, write_capture_scene

    capture = read_capture(capture_folder)
    names = variant_labels(reconstructions)
    each = tuple(
        _reconstruction(folder, name) for folder, name in zip(reconstructions, names, strict=True)
    )
    scene = CaptureScene(
        variants=each,
        cameras=_camera_path(capture, reconstructions[0]),
        source_mesh=_source_mesh(capture_folder),
        surface=_surface(each[0], reconstructions[0], capture_folder) if surface else None,
        course=load_snapshots(reconstructions[0]),
        metadata=scene_metadata(reconstructions[0]) | _data_hash(capture_folder),
    )
    write_capture_scene(path, scene, options)
    return len(each[0].gaussians)


def scene_metadata(reconstruction: Path) -> dict[str, Any]:
    """Return what is known about the making of a reconstruction.

    USD has no place for what the training assumed of its renderer: its constants are part of it.
    """
    from digs_warp.splat.config import DEFAULT_OPTIONS as options

    kernel = {
        "dilation_px2": options.dilation,
        "min_alpha": options.min_alpha,
        "max_alpha": options.max_alpha,
    }
    metadata: dict[str, Any] = {"kernel": kernel}
    if (reconstruction / RUN_RECORD).is_file():
        record = read_json(reconstruction / RUN_RECORD, "run record")
        metadata |= {key: record[key] for key in ("settings", "versions") if key in record}
    if (reconstruction / EVALUATION).is_file():
        metadata["held_out"] = read_quality(reconstruction).mean
    return metadata


def variant_labels(reconstructions: Sequence[Path]) -> list[str]:
    """Return a name for each: its initialization, else its folder; numbered where they repeat."""
    names = []
    for folder in reconstructions:
        name = folder.resolve().name
        if (folder / RUN_RECORD).is_file():
            settings = read_json(folder / RUN_RECORD, "run record").get("settings") or {}
            name = (settings.get("init") or {}).get("strategy") or name
        names.append(name)
    return [
        f"{name} {names[: i + 1].count(name)}" if names.count(name) > 1 else name
        for i, name in enumerate(names)
    ]


def _reconstruction(folder: Path, name: str) -> "SceneVariant":
    from digs_warp.data.gaussians import Gaussians
    from digs_warp.data.point_cloud import PointCloud
    from digs_warp.usd.capture_scene import SceneVariant

    points = (
        PointCloud.load(folder / INITIAL_POINTS) if (folder / INITIAL_POINTS).is_file() else None
    )
    metadata = scene_metadata(folder)
    own = {key: metadata[key] for key in ("settings", "held_out") if key in metadata}
    return SceneVariant(name, Gaussians.load(folder / GAUSSIANS), points, own)


def _camera_path(capture: Capture, reconstruction: Path) -> "CameraPath | None":
    """Return the cameras as the reconstruction used them, in the order of the recording."""
    from digs_warp.data.posed_frames import CAMERAS, PosedFrames
    from digs_warp.usd.cameras import CameraPath

    frames: list[tuple[Frame, bool]] = [(frame, False) for frame in capture.frames]
    if (reconstruction / CAMERAS).is_file():
        posed = PosedFrames.load(capture, reconstruction)
        frames = [
            *((frame, False) for frame in posed.training),
            *((frame, True) for frame in posed.held_out),
        ]
    frames.sort(key=lambda entry: (entry[0].time, entry[0].name))
    times = [frame.time for frame, _ in frames]
    if any(later <= before for before, later in pairwise(times)):
        times = [float(i) for i in range(len(frames))]  # photographs without a clock
    try:
        return CameraPath(
            cameras=tuple(frame.camera for frame, _ in frames),
            times=tuple(times),
            names=tuple(frame.name for frame, _ in frames),
            held_out=tuple(held_out for _, held_out in frames),
            baseline=capture.rig.baseline if capture.rig else None,
        )
    except DigsError as error:
        logger.warning("the scene gets no cameras: %s", error)
        return None


def _source_mesh(capture_folder: Path) -> "TriangleMesh | None":
    from digs_warp.surface.true_surface import read_true_surface

    try:
        return read_true_surface(capture_folder)
    except DigsError as error:
        logger.warning("the scene gets no source mesh: %s", error)
        return None


def _surface(shown: "SceneVariant", folder: Path, capture_folder: Path) -> "TriangleMesh":
    from digs_warp.commands.extract_mesh import extract_mesh

    return extract_mesh(shown.gaussians, folder, capture_folder).mesh


def _data_hash(capture_folder: Path) -> dict[str, str]:
    """Return one hash over the recording's files, from the hashes that its record lists."""
    record = capture_folder / RUN_RECORD
    if not record.is_file():
        return {}
    hashes = (read_json(record, "run record").get("results") or {}).get("sha256") or {}
    lines = "".join(f"{hashes[name]}  {name}\n" for name in sorted(hashes))
    return {"capture_sha256": hashlib.sha256(lines.encode()).hexdigest()} if hashes else {}
