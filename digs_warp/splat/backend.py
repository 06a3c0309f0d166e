"""The seam of the rasterizer: a backend turns the arrays of a view into launches of kernels.

Two backends draw the same: `VectorizedBackend` on a CPU, a thread per tile in vector code;
`CooperativeBackend` on CUDA, a block of threads per tile. `backend_for` chooses by the device.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import warp as wp

from digs_warp.device.parallel import ParallelLaunch, default_threads
from digs_warp.splat.cooperative import (
    WARP,
    CooperativeLaunch,
    backward_cooperative_kernel,
    forward_cooperative_kernel,
    sum_records_kernel,
)
from digs_warp.splat.project import project_kernel
from digs_warp.splat.project_adjoint_group import project_backward_group_kernel
from digs_warp.splat.project_group import project_group_kernel
from digs_warp.splat.rasterize import forward_kernel
from digs_warp.splat.rasterize_adjoint import backward_kernel
from digs_warp.splat.records import COLOR_FIELDS, GROUP_SIZE
from digs_warp.splat.shape_gradient import project_backward_kernel

# A thread adds up so many gradient records of a Gaussian by itself, a warp adds up more.
MOST_RECORDS = 8


@dataclass(frozen=True, eq=False)
class RasterJob:
    """What the kernels of a renderer read and write; structs are those of `digs_warp.splat.records`."""

    device: str
    threads: int
    depths: int  # that the view has
    count: int  # of Gaussians
    tiles: int  # of the largest view
    degree: int  # bands of the color
    gaussians: Any  # `GaussianArrays`, as the next one
    gradients: Any
    splats: Any  # `Splats`
    pairs: Any  # `TilePairs`
    pair_gradients: Any  # `PairGradients`
    background: wp.array  # color, (3,)
    filled: (
        wp.array
    )  # tile columns first .. end and rows first .. end whose empty tiles are filled, (4,)
    drawn: Any  # `Planes`
    ends: (
        wp.array
    )  # one past the last pair that was drawn, of each tile or pixel: `RasterBackend.ends`
    adjoint: Any  # `Planes`
    statistics: Any  # `StatisticsArrays`

    def launch(
        self, kernel: Any, dim: int, inputs: list[Any], even: bool = False
    ) -> Callable[[], None]:
        """Record a launch on all threads, see `ParallelLaunch`."""
        return ParallelLaunch(kernel, dim, inputs, self.device, self.threads, even).run


@dataclass(frozen=True, eq=False)
class RasterLaunches:
    """The launches of a view, in order; the binner lists the tiles between the first two."""

    project: Callable[[], None]
    forward: Callable[[], None]
    backward: Callable[[], None]
    project_backward: Callable[[], None]


@dataclass(frozen=True)
class VectorizedBackend:
    """A thread per tile, and per group of Gaussians, in loops that LLVM turns into vector code."""

    skips_empty_tiles = True  # outside of `RasterJob.filled`: they keep what they held

    def threads(self, wanted: int) -> int:
        """Return how many CPU threads may run; 0 means all cores. Results do not depend on it."""
        return wanted or default_threads()

    def ends(self, tiles: int, pixels: int) -> int:
        """Return the length of `RasterJob.ends`: one for each tile of the largest view."""
        return tiles

    def record(self, job: RasterJob) -> RasterLaunches:
        """Record the launches."""
        groups = -(-job.count // GROUP_SIZE)
        project = [job.gaussians, job.degree, job.splats]
        raster = [job.splats, job.pairs, job.background, job.filled, job.drawn, job.ends]
        adjoint = [job.splats, job.pairs, job.drawn, job.ends, job.adjoint]
        backward = backward_kernel(job.depths > 0)
        pulled = [*project, job.pair_gradients, job.gradients, job.statistics]
        return RasterLaunches(
            job.launch(project_group_kernel, groups, project, even=True),
            job.launch(forward_kernel(job.depths), job.tiles, raster),
            job.launch(backward, job.tiles, [*adjoint, job.pair_gradients.records]),
            job.launch(project_backward_group_kernel, groups, pulled, even=True),
        )


@dataclass(frozen=True)
class CooperativeBackend:
    """A block of threads per tile; on a CPU only for tests."""

    skips_empty_tiles = False

    def threads(self, wanted: int) -> int:
        """Return 1: Warp's blocks on a CPU share their memory."""
        return 1

    def ends(self, tiles: int, pixels: int) -> int:
        """Return one for each padded pixel."""
        return pixels

    def record(self, job: RasterJob) -> RasterLaunches:
        """Record the launches."""
        project = [job.gaussians, job.degree, job.splats]
        raster = [job.splats, job.pairs, job.background, job.drawn, job.ends]
        adjoint = [job.splats, job.pairs, job.drawn, job.ends, job.adjoint]
        adjoint += [job.pair_gradients.records]
        warps = -(-job.count // WARP) * WARP
        records = [job.pair_gradients, MOST_RECORDS]
        sum_records = sum_records_kernel(COLOR_FIELDS + (job.depths > 0))
        add_up = job.launch(sum_records, warps, records)
        pulled = [*project, *records, job.gradients, job.statistics]
        pull_back = job.launch(project_backward_kernel, job.count, pulled, even=True)

        def project_backward() -> None:
            add_up()
            pull_back()

        forward = forward_cooperative_kernel(job.depths)
        backward = backward_cooperative_kernel(job.depths > 0)
        return RasterLaunches(
            job.launch(project_kernel, job.count, project, even=True),
            CooperativeLaunch(forward, job.tiles, raster, job.device).run,
            CooperativeLaunch(backward, job.tiles, adjoint, job.device).run,
            project_backward,
        )


RasterBackend: TypeAlias = VectorizedBackend | CooperativeBackend


def backend_for(device: str) -> RasterBackend:
    """Return the backend that draws on a Warp device."""
    return VectorizedBackend() if device == "cpu" else CooperativeBackend()
