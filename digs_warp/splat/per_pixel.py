"""Launches of the raster kernels that have a thread per pixel: in blocks that share a tile, or each alone."""

from dataclasses import dataclass
from typing import Any

import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.rasterize_cooperative import forward_cooperative_kernel, launch_cooperative
from digs_warp.splat.rasterize_cooperative_adjoint import backward_cooperative_kernel
from digs_warp.splat.rasterize_reference import (
    backward_reference_kernel,
    forward_reference_kernel,
)
from digs_warp.splat.records import GradientLayout


@dataclass(frozen=True)
class PerPixel:
    """Which of these kernels draw.

    Attributes:
        in_blocks: a block of threads shares a tile; otherwise every thread reads all for itself.
        options: how splats are drawn, and what a view gives.
    """

    in_blocks: bool
    options: RasterOptions

    def forward(self, image: ImagePlanes, tiles: int, arguments: list[Any]) -> None:
        """Draw ``tiles`` tiles of ``image``; the kernels name their arguments."""
        if self.in_blocks:
            kernel = forward_cooperative_kernel(self.options.has_depth, self.options.has_normals)
            launch_cooperative(kernel, tiles, arguments, str(image.data.device))
        else:
            _launch_plain(forward_reference_kernel, image, arguments)

    def backward(
        self,
        image: ImagePlanes,
        tiles: int,
        arguments: list[Any],
        pairs: tuple[wp.array, wp.array],
        layout: GradientLayout,
    ) -> None:
        """Fill the gradients of the pairs.

        Args:
            image: the view.
            tiles: of the view.
            arguments: those of the forward kernels and the gradients of their outputs.
            pairs: tile_pairs, and pair_gradients, which is written.
            layout: of a record of pair_gradients.
        """
        if self.in_blocks:
            kernel = backward_cooperative_kernel(
                self.options.has_depth, self.options.has_normals, layout.absolute >= 0
            )
            launch_cooperative(kernel, tiles, [*arguments, *pairs], str(image.data.device))
        else:
            pairs[1].zero_()
            fields = [layout.depth, layout.normal, layout.absolute]
            _launch_plain(backward_reference_kernel, image, [*arguments, *fields, *pairs])


def _launch_plain(kernel: Any, image: ImagePlanes, arguments: list[Any]) -> None:
    size = image.height, image.width
    wp.launch(kernel, dim=size, inputs=arguments, device=image.data.device, record_tape=False)
