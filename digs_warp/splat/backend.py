"""The seam of the rasterizer: a backend turns the arrays of a view into launches of kernels.

Two backends draw the same: `VectorizedBackend` on a CPU, a thread per tile in vector code;
`CooperativeBackend` on CUDA, a block of threads per tile. `backend_for` chooses by the device.
"""

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import warp as wp

from digs_warp.device.parallel import ParallelLaunch, default_threads
from digs_warp.splat.config import RasterOptions
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
from digs_warp.splat.records import GROUP_SIZE
from digs_warp.splat.shape_gradient import project_backward_kernel

# A thread adds up so many gradient records of a Gaussian by itself, a warp adds up more.
MOST_RECORDS = 8


@dataclass(frozen=True, eq=False)
class RasterJob:
    """What the kernels of a renderer read and write; structs are those of `digs_warp.splat.records`.

    Attributes:
        device: Warp device of all arrays.
        threads: CPU threads.
        options: how splats are drawn.
        fields: columns of the gradient records.
        count: number of Gaussians.
        tiles: of the largest view.
        degree: bands of the color.
        gaussians: parameters, `GaussianArrays`.
        gradients: of the parameters, `GaussianArrays`.
        splats: `Splats`.
        pairs: `TilePairs`.
        pair_gradients: `PairGradients`.
        background: color, (3,).
        filled: tile columns first .. end and rows first .. end whose empty tiles have to be filled, (4,).
        drawn: the view, `Planes`.
        ends: one past the last pair that was drawn, of each tile or pixel: `RasterBackend.ends` of them.
        adjoint: gradient of the loss in the view, `Planes`.
        statistics: `StatisticsArrays`.
    """

    device: str
    threads: int
    options: RasterOptions
    fields: int
    count: int
    tiles: int
    degree: int
    gaussians: Any
    gradients: Any
    splats: Any
    pairs: Any
    pair_gradients: Any
    background: wp.array
    filled: wp.array
    drawn: Any
    ends: wp.array
    adjoint: Any
    statistics: Any

    def launch(
        self, kernel: Any, dim: int, inputs: list[Any], even: bool = False
    ) -> ParallelLaunch:
        """Record a launch on all threads, see `ParallelLaunch`."""
        return ParallelLaunch(kernel, dim, inputs, self.device, self.threads, even)


class Launch(Protocol):
    """A recorded launch."""

    def run(self) -> None:
        """Execute and wait."""
        ...


@dataclass(frozen=True)
class Launches:
    """Several, one after the other."""

    parts: list[Launch]

    def run(self) -> None:
        """Execute and wait."""
        for part in self.parts:
            part.run()


@dataclass(frozen=True, eq=False)
class RasterLaunches:
    """The launches of a view, in order; the binner lists the tiles between the first two."""

    project: Launch
    forward: Launch
    backward: Launch
    project_backward: Launch


@dataclass(frozen=True)
class VectorizedBackend:
    """A thread per tile, and per group of Gaussians, in loops that LLVM turns into vector code."""

    counting = True  # how `digs_warp.splat.bin_tiles.TileBinner` makes the tile lists
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
        backward = backward_kernel(job.options)
        pulled = [*project, job.pair_gradients, job.gradients, job.statistics]
        return RasterLaunches(
            job.launch(project_group_kernel, groups, project, even=True),
            job.launch(forward_kernel(job.options), job.tiles, raster),
            job.launch(backward, job.tiles, [*adjoint, job.pair_gradients.records]),
            job.launch(project_backward_group_kernel, groups, pulled, even=True),
        )


@dataclass(frozen=True)
class CooperativeBackend:
    """A block of threads per tile; on a CPU only for tests."""

    counting = False
    skips_empty_tiles = False

    def threads(self, wanted: int) -> int:
        """Return 1: Warp's blocks on a CPU share their memory."""
        return 1

    def ends(self, tiles: int, pixels: int) -> int:
        """Return one for each padded pixel."""
        return pixels

    def record(self, job: RasterJob) -> RasterLaunches:
        """Record the launches."""
        forward = forward_cooperative_kernel(job.options.depth_channels)
        backward = backward_cooperative_kernel(job.options.has_depth)
        sum_records = sum_records_kernel(job.fields)
        each = [job.gaussians, job.degree, job.splats]
        pulled = [*each, job.pair_gradients, MOST_RECORDS, job.gradients, job.statistics]
        raster = [job.splats, job.pairs, job.background, job.drawn, job.ends]
        adjoint = [job.splats, job.pairs, job.drawn, job.ends, job.adjoint]
        return RasterLaunches(
            job.launch(project_kernel, job.count, each, even=True),
            CooperativeLaunch(forward, job.tiles, raster, job.device),
            CooperativeLaunch(
                backward, job.tiles, [*adjoint, job.pair_gradients.records], job.device
            ),
            Launches(
                [
                    job.launch(
                        sum_records,
                        -(-job.count // WARP) * WARP,
                        [job.pair_gradients, MOST_RECORDS],
                    ),
                    job.launch(project_backward_kernel, job.count, pulled, even=True),
                ]
            ),
        )


RasterBackend: TypeAlias = VectorizedBackend | CooperativeBackend


def backend_for(device: str) -> RasterBackend:
    """Return the backend that draws on a Warp device."""
    return VectorizedBackend() if device == "cpu" else CooperativeBackend()
