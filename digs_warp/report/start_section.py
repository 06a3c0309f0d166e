"""What the training started from: camera poses, their scale, and the points."""

from collections.abc import Mapping
from typing import Any

from digs_warp.report.markup import number, section, table
from digs_warp.report.results import Results

_SOURCES = {
    "depth": "from the depth maps",
    "sfm": "from structure from motion",
    "random": "at random",
}


def start_section(results: Results) -> str:
    """Return the section, or nothing for a record without these results."""
    record = results.run.get("results") or {}
    parts = [
        *_table("Poses from structure from motion", _sfm_rows(record.get("sfm"))),
        *_table("Scale of the poses, told by the depth maps", _scale_rows(record.get("scale"))),
        *_table("Points to start from", _point_rows(record.get("initialization"))),
    ]
    if not parts:
        return ""
    warning = (record.get("scale") or {}).get("warning")
    intro = "Camera poses place the depth maps; what they agree on becomes the first Gaussians."
    return section("Start", f"{intro} Warning: {warning}" if warning else intro, *parts)


def _table(title: str, rows: list[tuple[str, str]]) -> list[str]:
    return [f"<h3>{title}</h3>{table(['', ''], rows)}"] if rows else []


def _sfm_rows(quality: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if not quality:
        return []
    return [
        ("images registered", f"{quality['registered']} of {quality['images']}"),
        ("separate models", str(quality["models"])),
        ("sparse points", f"{quality['points']:,}"),
        ("images that see a point, mean", number(quality["track_length"], 1)),
        ("reprojection error, mean", number(quality["reprojection_error_px"], 2, "px")),
        ("angle between a point's rays, median", number(quality["ray_angle_deg"], 0, "°")),
    ]


def _scale_rows(scale: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if not scale:
        return []
    share = 100 * scale["width"] / scale["sfm_per_metre"]
    return [
        ("units of the model per metre", number(scale["sfm_per_metre"], 4)),
        ("spread of the single measurements", number(share, 2, "%")),
        ("measurements", f"{scale['values']:,}"),
        ("peaks of their distribution", str(scale["modes"])),
    ]


def _point_rows(start: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if not start:
        return []
    sources: dict[str, int] = start["sources"]
    rows = [(_SOURCES.get(name, name), f"{count:,}") for name, count in sources.items()]
    if start.get("voxel_size"):
        rows.append(("edge of the voxels", number(1e3 * start["voxel_size"], 2, "mm")))
    rows += [(f"pixels {name}", f"{count:,}") for name, count in start.get("pixels", {}).items()]
    rows += [(f"voxels {name}", f"{count:,}") for name, count in start.get("voxels", {}).items()]
    return rows
