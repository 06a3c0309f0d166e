"""What became of the pixels of the depth maps, in words."""

from collections.abc import Iterator
from itertools import pairwise

from digs_warp.init.start import DepthReport

# What drops pixels between one of `digs_warp.init.view_points.FILTERS` and the next.
STAGES = ("missing depth", "the edge filter", "the foreground filter")


def what_was_dropped(report: DepthReport) -> str:
    """Return the counts after each stage, and the stage that dropped the largest share."""
    share, stage = max(_shares(report))
    pixels = ", ".join(f"{count:,} {name}" for name, count in report.pixels.items())
    return (
        f"pixels: {pixels}; voxels of {1e3 * report.voxel_size:.2g} mm, the resolution of the depth maps: "
        f"{report.voxels['occupied']:,} occupied; {stage} dropped most, {share:.0%}"
    )


def _shares(report: DepthReport) -> Iterator[tuple[float, str]]:
    """Yield the share that each stage dropped of what the one before it left."""
    for (before, after), stage in zip(pairwise(report.pixels.values()), STAGES, strict=True):
        yield 1 - after / max(before, 1), stage
