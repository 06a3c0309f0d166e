"""Render views with motion blur: `digs_warp.splat.camera_motion` has the formulas."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from digs_warp.device.contiguous import flat
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch, run_together
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import PixelBox
from digs_warp.splat.bin_tiles import pixels_of
from digs_warp.splat.camera_motion import Blur, RowMotion
from digs_warp.splat.config import DEFAULT_OPTIONS, RasterOptions
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.splat.renderer import WHITE, SplatRenderer

wp.set_module_options({"enable_backward": False})


@wp.kernel
def mean_kernel(
    first: int,
    share: float,
    source: wp.array[float],
    # outputs
    target: wp.array[float],
):
    """Set a value to ``share * (target + source)``."""
    i = first + wp.tid()
    target[i] = share * (target[i] + source[i])


# Place of the share among the inputs of the kernel.
_SHARE = 0


class BlurRenderer:
    """Renders views of a moving camera, and pulls image gradients back to the Gaussians.

    A `SplatRenderer` for each moment; with one moment, it is that renderer, to the bit.

    Args:
        gaussians: the parameters, as in `SplatRenderer`.
        width: width of the largest view [px].
        height: height of the largest view [px].
        options: how splats are drawn, and what a view gives.
        moments: the most that a view has.
        threads: CPU threads; 0 means all cores. The result does not depend on it.

    After `forward`, ``image`` and ``transmittance`` hold the means. The renderer ``middle`` holds the view of
    the moment nearest to the middle of the exposure, with its depth. Put the gradients of a loss into
    ``adj_image``, ``adj_transmittance`` and ``middle.adj_depth``; that in the depth times `moments`, because
    `backward` gives the mean over the moments, and only one of them has depth.
    """

    def __init__(
        self,
        gaussians: DeviceGaussians,
        width: int,
        height: int,
        *,
        options: RasterOptions = DEFAULT_OPTIONS,
        moments: int = 1,
        threads: int = 0,
    ) -> None:
        self.middle = SplatRenderer(gaussians, width, height, options=options, threads=threads)
        color = replace(options, outputs="color")
        others = [
            SplatRenderer(
                *(gaussians, width, height),
                options=color,
                adjoint_of=self.middle,
                threads=threads,
            )
            for _ in range(moments - 1)
        ]
        self._renderers = [self.middle, *others]
        self.adj_image = self.middle.adj_image
        self.adj_transmittance = self.middle.adj_transmittance
        self.image, self.transmittance = self.middle.image, self.middle.transmittance
        if others:  # the backward pass still needs the views themselves
            device = gaussians.device
            self.image = ImagePlanes(width, height, 3, device)
            self.transmittance = ImagePlanes(width, height, 1, device)
        means = self.image.data, self.transmittance.data
        self._views = [
            self._sum_launches((r.image.data, r.transmittance.data), means) for r in others
        ]
        self._drawn = self._renderers[:1]
        self._sums: list[list[ParallelLaunch]] = []
        self._bind_gradients()

    @property
    def gaussians(self) -> DeviceGaussians:
        """The parameters."""
        return self.middle.gaussians

    @property
    def gradients(self) -> DeviceGaussians:
        """Of the parameters, after `backward`."""
        return self.middle.gradients

    @property
    def moments(self) -> int:
        """How many views the last image is the mean of."""
        return len(self._drawn)

    @property
    def statistics(self) -> SplatStatistics | None:
        """Statistics that `backward` adds to, as in `SplatRenderer`; every moment counts as a view."""
        return self.middle.statistics

    @statistics.setter
    def statistics(self, statistics: SplatStatistics | None) -> None:
        for renderer in self._renderers:
            renderer.statistics = statistics

    def set_gaussians(self, gaussians: DeviceGaussians) -> None:
        """Render other Gaussians from now on, as in `SplatRenderer`."""
        for renderer in self._renderers:
            renderer.set_gaussians(gaussians)
        self._bind_gradients()

    def forward(
        self,
        camera: Camera,
        *,
        near: float,
        background: np.ndarray | tuple[float, float, float] = WHITE,
        sh_degree: int | None = None,
        content: PixelBox | None = None,
        rows: RowMotion | None = None,
        blur: Blur | None = None,
    ) -> None:
        """Render one view into ``image`` and ``transmittance``.

        Args:
            camera: in the middle of the exposure; see also `SplatRenderer.forward`.
            near: near plane [m].
            background: sRGB color behind the Gaussians.
            sh_degree: bands of the color to use.
            content: pixels that are looked at although no splat may be there.
            rows: how the camera moves while the rows are read.
            blur: how it moves while the shutter is open. Default: it does not.

        Raises:
            ValueError: the view has more moments than the renderer.
        """
        cameras = [camera] if blur is None else blur.cameras(camera)
        if len(cameras) > len(self._renderers):
            raise ValueError(f"view of {len(cameras)} moments, renderer of {len(self._renderers)}")
        self._drawn = self._renderers[: len(cameras)]
        # Splats reach other tiles at every moment, and each view has to show the background in all of them.
        seen = content if len(cameras) == 1 else None
        for renderer, at_moment in zip(self._drawn, cameras, strict=True):
            renderer.forward(
                at_moment,
                near=near,
                background=background,
                sh_degree=sh_degree,
                content=seen,
                rows=rows,
            )
        if self.image is not self.middle.image:
            for mean, first in (
                (self.image, self.middle.image),
                (self.transmittance, self.middle.transmittance),
            ):
                mean.resize(first.width, first.height)
                wp.copy(mean.data, first.data)
            self._sum(self._views)

    def backward(self) -> None:
        """Fill ``gradients`` from the ``adj_`` planes for the last `forward`."""
        for renderer in self._drawn:
            renderer.backward()
        self._sum(self._sums)

    def drawn_tiles(self) -> np.ndarray:
        """Return which tiles have splats at any moment, shape (rows, columns), bool."""
        return np.logical_or.reduce([r.binner.drawn_tiles() for r in self._drawn])

    def drawn_box(self) -> PixelBox:
        """Return the pixels (x0, y0, x1, y1) of the tiles that have splats; all 0 when none has."""
        image = self.middle.image
        return pixels_of(self.drawn_tiles(), image.width, image.height)

    def _sum(self, of_others: list[list[ParallelLaunch]]) -> None:
        """Turn what the first moment gives into the mean over all that are drawn."""
        last = len(self._drawn) - 1
        for number, launches in enumerate(of_others[:last], start=1):
            for launch in launches:
                launch.set_param(_SHARE, 1.0 / (last + 1) if number == last else 1.0)
            run_together(launches)

    def _sum_launches(
        self, sources: Sequence[wp.array], targets: Sequence[wp.array]
    ) -> list[ParallelLaunch]:
        """Record what adds flat arrays to others, see `mean_kernel`."""
        given = self.middle.device, self.middle.threads
        return [
            ParallelLaunch(mean_kernel, len(target), [1.0, source, target], *given, even=True)
            for source, target in zip(sources, targets, strict=True)
        ]

    def _bind_gradients(self) -> None:
        """Record what adds the gradients of every further moment to those of the first."""
        first = [*map(flat, self.middle.gradients.arrays)]
        self._sums = [
            self._sum_launches([*map(flat, renderer.gradients.arrays)], first)
            for renderer in self._renderers[1:]
        ]
