"""Facts about Gaussians, reconstructions and whole runs."""

from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.engines.task import Results
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record import layout
from digs_warp.show.report.facts.captures import of_capture
from digs_warp.show.report.facts.words import (
    Facts,
    extent_words,
    megabytes,
    record_facts,
    seconds_facts,
)
from digs_warp.words import counted


def of_gaussians(path: Path) -> Facts:
    """Number, degree, extent, typical size and opacity."""
    return _of_gaussians(Gaussians.load(path), path)


def of_splat_file(path: Path) -> Facts:
    """The same for a PLY, SPZ or .splat file; PLY and .splat in the axes of the file."""
    from digs_warp.formats.splats.files import read_splat_file

    return _of_gaussians(read_splat_file(path), path)


def _of_gaussians(gaussians: Gaussians, path: Path, unit: str = "m") -> Facts:
    facts = {
        "kind": "Gaussians",
        "number": counted(len(gaussians), "Gaussian"),
        "spherical harmonics": f"degree {gaussians.sh_degree}",
        "file size": megabytes(path),
    }
    if len(gaussians):
        size = float(np.median(np.exp(gaussians.log_scales.mean(axis=1))))
        words = f"{1e3 * size:.2f} mm" if unit == "m" else f"{size:.3g} {unit}"
        facts["extent"] = extent_words(gaussians.means, unit)
        facts["size"] = f"{words} standard deviation (median)"
        facts["opacity"] = f"{np.median(gaussians.opacities):.2f} (median)"
    return facts


def of_reconstruction(folder: Path) -> Facts:
    """The Gaussians, how well they match the held-out views, what each stage found, and how long it took."""
    result = Reconstruction.load(folder, partial=True)
    scale = result.poses.metric_scale
    facts = _of_gaussians(result.gaussians, folder / layout.GAUSSIANS, scale.unit if scale else "m")
    facts["kind"] = "reconstruction"
    if result.scores.views:
        facts["quality"] = result.quality
    for stage in result.figures.values():
        facts |= stage
    return facts | seconds_facts(result.run)


def of_run(folder: Path) -> Facts:
    """The results of 'digs-warp run': one line per part."""
    facts = {"kind": "results of 'digs-warp run'"}
    parts = {
        "capture": (layout.CAPTURE, of_capture, "{length}, {image size}"),
        "reconstruction": (layout.RECONSTRUCTION, of_reconstruction, "{number}, {quality}"),
    }
    for name, (place, summary, words) in parts.items():
        try:
            facts[name] = words.format(**summary(folder / place))
        except (DigsError, KeyError):
            facts[name] = "not finished"
    for name, place in {
        "scene": layout.SCENE,
        "splats": layout.SPLATS,
        "report": layout.REPORT,
    }.items():
        path = folder / place
        facts[name] = f"{path} ({megabytes(path)})" if path.is_file() else "not finished"
    return facts | record_facts(folder)


def of_many_results(folder: Path) -> Facts:
    """How many cases have a line in a folder of 'digs-warp reconstruct' or 'study run', and which failed."""
    records = Results(folder).records.values()
    failed = [str(record.get("name", record["key"])) for record in records if "error" in record]
    is_study = not any("capture" in record for record in records)
    return {
        "kind": "study" if is_study else "reconstructions",
        "length": counted(len(records), "case" if is_study else "capture"),
        "failed": ", ".join(failed) or "none",
    } | record_facts(folder)
