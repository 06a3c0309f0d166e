"""What an initialization returns. Imports nothing heavy: reading a result must not load the init code."""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.config import StrategyName
from digs_warp.record.results import Figure
from digs_warp.record.typed import NOT_STORED

if TYPE_CHECKING:
    from digs_warp.init.view_points import ViewPoints

# Later stages thin layers and coarsen grids: they keep little of many voxels, as they should.
JUDGED_VOXELS = ("occupied", "not seen through")

# What is reconstructed: what lies in the masks, or everything in view.
Subject = Literal["object", "scene"]


@dataclass
class DepthReport:
    """How many pixels and voxels passed each step.

    Attributes:
        voxel_size: edge length of the final grid [m].
        pixels: sums over all views of the pixels left after each filter.
        voxels: how many were left after each step on the grid.
    """

    voxel_size: float = 0.0
    pixels: dict[str, int] = field(default_factory=dict)
    voxels: dict[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        size = f"voxels of {1e3 * self.voxel_size:.2f} mm; " if self.voxel_size else ""
        counts = {"pixels": self.pixels, "voxels": self.voxels}
        return size + "; ".join(
            f"{what} " + ", ".join(f"{name} {count:,}" for name, count in each.items())
            for what, each in counts.items()
            if each
        )

    @property
    def kept(self) -> dict[str, float]:
        """The share of pixels, and of voxels that views contradict, that each stage kept; 1 of none."""
        voxels = {name: self.voxels[name] for name in JUDGED_VOXELS if name in self.voxels}
        return {
            name: after / before if before else 1.0
            for counts in (self.pixels, voxels)
            for (_, before), (name, after) in pairwise(counts.items())
        }

    def add(self, view: "ViewPoints") -> None:
        """Count a view."""
        for name, count in view.pixels.items():
            self.pixels[name] = self.pixels.get(name, 0) + count


@dataclass(frozen=True, eq=False)
class Start:
    """The record of the initialization: the points to start from, and how they were made.

    Attributes:
        points: in the world [m]; initial_points.npz has them.
        sources: number of points by where they came from: "depth", "sfm", "recorded" (with the recording),
            "hull" (of the masks), "random", "shell", "unseen" (where they close the object).
        depth: how many pixels of the depth maps were used; None if the strategy does not use depth.
        because: what they are and why, in words; empty where it is not known.
        strategy: how they were made, where that is not what the settings say.
    """

    points: Annotated[PointCloud, NOT_STORED]
    sources: Annotated[dict[str, int], Figure("initial points")] = field(default_factory=dict)
    depth: Annotated[DepthReport | None, Figure("used of the depth maps")] = None
    because: Annotated[str, Figure("started from")] = ""
    strategy: StrategyName | None = None
