"""What the training started from: camera poses, their scale, and the points."""

from digs_warp.data.metric_scale import MetricScale
from digs_warp.init.scale import ScaleEstimate
from digs_warp.init.start import Initialization
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.poses.from_images.quality import SfmQuality
from digs_warp.show.report.markup import number, section, table

_SOURCES = {
    "depth": "from the depth maps",
    "sfm": "from structure from motion",
    "recorded": "that came with the recording",
    "hull": "on the hull of the masks",
    "random": "at random",
    "shell": "on a far shell",
    "unseen": "where no view saw the object",
}


def start_section(result: Reconstruction) -> str:
    """Return the section, or nothing if no figures about the start are known."""
    parts = [
        *_table("Poses from structure from motion", _sfm_rows(result.sfm)),
        *_table("Scale of the poses, from the depth maps", _scale_rows(result.scale)),
        *_table("Unit of lengths", _unit_rows(result.metric_scale)),
        *_table("Points to start from", _point_rows(result.start)),
    ]
    if not parts:
        return ""
    warning = result.scale.warning if result.scale else ""
    intro = "Camera poses place the depth maps; where they agree, the first Gaussians are placed."
    return section("Start", f"{intro} Warning: {warning}" if warning else intro, *parts)


def _table(title: str, rows: list[tuple[str, str]]) -> list[str]:
    return [f"<h3>{title}</h3>{table(['', ''], rows)}"] if rows else []


def _sfm_rows(quality: SfmQuality | None) -> list[tuple[str, str]]:
    if quality is None:
        return []
    return [
        ("images registered", f"{quality.registered} of {quality.images}"),
        ("separate models", str(quality.models)),
        ("sparse points", f"{quality.points:,}"),
        ("images that see a point, mean", number(quality.track_length, 1)),
        ("reprojection error, mean", number(quality.reprojection_error_px, 2, "px")),
        ("angle between a point's rays, median", number(quality.ray_angle_deg, 0, "°")),
    ]


def _scale_rows(scale: ScaleEstimate | None) -> list[tuple[str, str]]:
    if scale is None:
        return []
    share = 100 * scale.width / scale.sfm_per_metre
    return [
        ("units of the model per metre", number(scale.sfm_per_metre, 4)),
        ("spread of the individual measurements", number(share, 2, "%")),
        ("measurements", f"{scale.values:,}"),
        ("peaks of their distribution", str(scale.modes)),
    ]


def _unit_rows(scale: MetricScale | None) -> list[tuple[str, str]]:
    return [] if scale is None else [("scale", str(scale))]


def _point_rows(start: Initialization | None) -> list[tuple[str, str]]:
    if start is None:
        return []
    rows = [("chosen", start.because)] if start.because else []
    rows += [(_SOURCES.get(name, name), f"{count:,}") for name, count in start.sources.items()]
    if start.depth is None:
        return rows
    if start.depth.voxel_size:
        rows.append(("edge of the voxels", number(1e3 * start.depth.voxel_size, 2, "mm")))
    rows += [(f"pixels {name}", f"{count:,}") for name, count in start.depth.pixels.items()]
    rows += [(f"voxels {name}", f"{count:,}") for name, count in start.depth.voxels.items()]
    return rows
