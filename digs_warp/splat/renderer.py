"""Render Gaussians: project -> bin -> rasterize, and back, in buffers that are allocated once.

The trainer's tier; `digs_warp.splat.render.render` takes and returns NumPy values.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.checks import check_finite, check_positive, check_shape
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch, default_threads
from digs_warp.splat.background import add_background_kernel, tiles_with_background
from digs_warp.splat.bin_tiles import TileBinner
from digs_warp.splat.camera_gradient import CameraGradient, CameraShares
from digs_warp.splat.config import DEFAULT_OPTIONS, RasterOptions
from digs_warp.splat.device import DeviceGaussians, RasterKernels, raster_kernels
from digs_warp.splat.footprint import ViewParams, Window, view_params
from digs_warp.splat.group import GROUP_SIZE
from digs_warp.splat.per_pixel import PerPixel
from digs_warp.splat.project import project_kernel
from digs_warp.splat.project_adjoint import project_backward_kernel
from digs_warp.splat.project_adjoint_group import project_backward_group_kernel
from digs_warp.splat.project_group import project_group_kernel
from digs_warp.splat.rasterize import forward_kernel
from digs_warp.splat.rasterize_adjoint import backward_kernel
from digs_warp.splat.records import GradientLayout
from digs_warp.splat.statistics import SplatStatistics

WHITE = (1.0, 1.0, 1.0)


class SplatRenderer:
    """Renders views of one set of Gaussians, and pulls image gradients back to them.

    Args:
        gaussians: the parameters; their contents may change between calls, the arrays only by
            `set_gaussians`.
        width: width of the largest view [px].
        height: height of the largest view [px].
        options: how splats are drawn, and what a view gives.
        camera_gradient: whether `backward` also gives the gradient of the camera.
        kernels: which raster kernels draw. Default: those for the device.
        threads: CPU threads; 0 means all cores. The result does not depend on it.

    After `forward`, ``image``, ``transmittance``, and where ``options`` ask for them ``depth`` (channels:
    expected, median; 0 where there is none) and ``normals`` hold the view. Put the gradients of a loss into
    ``adj_image``, ``adj_transmittance``, ``adj_depth`` (of the expected depth) and ``adj_normals``, call
    `backward`, and find dL/dparameter in ``gradients``.
    """

    def __init__(
        self,
        gaussians: DeviceGaussians,
        width: int,
        height: int,
        *,
        options: RasterOptions = DEFAULT_OPTIONS,
        camera_gradient: bool = False,
        kernels: RasterKernels | None = None,
        threads: int = 0,
    ) -> None:
        device = gaussians.device
        self.device = device
        self.options = options
        self.kernels = kernels or raster_kernels(device)
        self.vectorized = self.kernels == "vectorized"
        self._per_pixel = PerPixel(self.kernels == "cooperative", options)
        # The atomics of the plain kernels are plain additions on a CPU: one thread.
        self.threads = (threads or default_threads()) if self.vectorized else 1

        def planes(channels: int, wanted: bool = True) -> ImagePlanes:
            return ImagePlanes(width, height, channels if wanted else 0, device)

        self.image = planes(3)
        self.transmittance = planes(1)
        self.depth = planes(2, options.has_depth)
        self.normals = planes(3, options.has_normals)
        self.adj_image = planes(3)
        self.adj_transmittance = planes(1)
        self.adj_depth = planes(1, options.has_depth)
        self.adj_normals = planes(3, options.has_normals)
        self._all_planes = [self.image, self.transmittance, self.depth, self.normals]
        self._all_planes += [self.adj_image, self.adj_transmittance]
        self._all_planes += [self.adj_depth, self.adj_normals]
        self._views = wp.zeros(1, dtype=ViewParams, device=device)  # pyright: ignore[reportArgumentType]
        self._background = wp.zeros(3, dtype=float, device=device)
        self._filled = wp.zeros(4, dtype=int, device=device)
        self._camera_gradient = camera_gradient
        self._statistics: SplatStatistics | None = None
        self.set_gaussians(gaussians)

    def set_gaussians(self, gaussians: DeviceGaussians) -> None:
        """Render other Gaussians from now on, of any number; the planes stay.

        ``gradients`` becomes a new object, and ``statistics`` are switched off.
        """
        count = len(gaussians)
        self.gaussians = gaussians
        self.gradients = gaussians.zeros_like()
        self._statistics = None
        self._normals = wp.zeros(
            count if self.options.has_normals else 0, dtype=wp.vec3, device=self.device
        )
        shares = count if self._camera_gradient else 0
        self._camera_shares = CameraShares(shares, self.device, self.threads)
        self._make_binner()

    @property
    def statistics(self) -> SplatStatistics | None:
        """Statistics that `backward` adds to; None (the default): none, at no cost."""
        return self._statistics

    @statistics.setter
    def statistics(self, statistics: SplatStatistics | None) -> None:
        if statistics is not None and statistics.counts.shape[0] != len(self.gaussians):
            raise ValueError(
                f"statistics of {statistics.counts.shape[0]} Gaussians, there are {len(self.gaussians)}"
            )
        before = self._layout
        self._statistics = statistics
        if self._layout != before:
            self._make_binner()  # its gradient records have another length
        self._generation = -1

    def forward(
        self,
        camera: Camera,
        *,
        near: float,
        background: tuple[float, float, float] | np.ndarray | ImagePlanes = WHITE,
        sh_degree: int | None = None,
        window: Window | None = None,
        content: Window | None = None,
    ) -> None:
        """Render one view into ``image``, ``transmittance`` and what else the options ask for.

        Args:
            camera: its image is at most as large as the renderer's; all planes take its size.
            near: Gaussians whose centre is nearer than this [m] are not drawn.
            background: sRGB colour behind the Gaussians, or an image of the renderer's size.
            sh_degree: bands of the colour to use; default: all that the Gaussians have.
            window: only the tiles that touch these pixels are drawn; the others keep what they held, and
                splats outside get no gradient. Default: the whole image.
            content: pixels that are looked at although no splat may be there. Tiles without splats that lie
                more than `FILLED_AROUND` tiles (`digs_warp.splat.background`) outside of the box of these
                and of all splats keep what they held: most of the image, when a single object is trained.
                Default: the whole image.

        Raises:
            ValueError: the camera's or the background's image does not fit the renderer.
            DigsError: the near plane is not above 0, or the background colour is not finite.
        """
        check_positive("near plane", near)
        k = camera.intrinsics
        if k.width > self.image.max_width or k.height > self.image.max_height:
            raise ValueError(
                f"camera of {k.width}x{k.height} px, renderer of "
                f"{self.image.max_width}x{self.image.max_height} px"
            )
        if (k.width, k.height) != (self.image.width, self.image.height):
            self._resize(k.width, k.height)
        self._views.assign(view_params(camera, near, self.options, window))
        behind = background if isinstance(background, ImagePlanes) else None
        color = np.zeros(3) if isinstance(background, ImagePlanes) else background
        color = np.asarray(color, dtype=np.float32)
        self._background.assign(check_finite("background", check_shape("background", color, (3,))))
        all_bands = round(self.gaussians.sh.shape[1] ** 0.5) - 1
        degree = min(all_bands, self.options.max_sh_degree, 3 if sh_degree is None else sh_degree)
        if degree != self._degree:
            self._record_projection(degree)
        self._project.run()
        self.binner.bin()
        if self.binner.generation != self._generation:
            self._record_rasterization()
        if self.vectorized:
            boxes = None if content is None else [self.binner.drawn_box(), content]
            filled = tiles_with_background(boxes, self.binner.columns, self.binner.rows)
            self._filled.assign(filled)
            self._forward.run()
        else:
            self._forward_per_pixel()
        if behind is not None:
            self._add_background(behind)

    def backward(self) -> None:
        """Fill ``gradients`` from the ``adj_`` planes for the last `forward`."""
        if self.vectorized:
            self._backward.run()
        else:
            self._backward_per_pixel()
        self._project_backward.run()

    def camera_gradient(self) -> CameraGradient:
        """Return the gradient of the camera in the last `backward`; summed in a fixed order.

        Raises:
            ValueError: the renderer was not made with ``camera_gradient``.
        """
        if not self._camera_gradient:
            raise ValueError("a renderer made without camera_gradient=True has none")
        return self._camera_shares.total()

    def stages(self) -> dict[str, Callable[[], object]]:
        """Return the stages of the last view by name, each ready to run again: for profiling."""
        return {
            "project": self._project.run,
            "bin": self.binner.bin,
            "forward": self._forward.run if self.vectorized else self._forward_per_pixel,
            "backward": self._backward.run if self.vectorized else self._backward_per_pixel,
            "gather and project back": self._project_backward.run,
        }

    @property
    def _layout(self) -> GradientLayout:
        absolute = self._statistics is not None and self._statistics.has_absolute
        return GradientLayout.of(self.options.has_depth, self.options.has_normals, absolute)

    def _make_binner(self) -> None:
        image = self.image
        self.binner = TileBinner(
            len(self.gaussians),
            image.max_width,
            image.max_height,
            self._views,
            self._layout.fields,
            self.threads,
            counting=self.vectorized,
        )
        stops = self.binner.tiles if self.vectorized else image.plane
        self._stops = wp.zeros(stops, dtype=int, device=self.device)
        self._max_tiles = self.binner.tiles
        self.binner.resize(image.width, image.height)
        self._degree = -1
        self._generation = -1

    def _resize(self, width: int, height: int) -> None:
        for planes in self._all_planes:
            planes.resize(width, height)
        self.binner.resize(width, height)

    def _record_projection(self, degree: int) -> None:
        """Record the launches that depend on the number of colour bands."""
        self._degree = degree
        lists = self.binner.lists
        outputs = [lists.splats, lists.depths, lists.first_tile_rows, lists.row_counts]
        count = len(self.gaussians)
        self._project = self._launch(
            project_group_kernel if self.vectorized else project_kernel,
            -(-count // GROUP_SIZE) if self.vectorized else count,
            [self._views, *self.gaussians.arrays, degree, *outputs, self._normals],
            even=True,
        )
        self._generation = -1

    def _record_rasterization(self) -> None:
        """Record the launches that hold the binner's growing buffers."""
        self._generation = self.binner.generation
        lists = self.binner.lists
        layout = self._layout
        statistics = self._statistics or SplatStatistics.zeros(0, self.device)
        pulled = [self._views, *self.gaussians.arrays, self._degree, lists.splats]
        pulled += [lists.pair_starts, lists.pair_gradients, layout.depth]
        if self.vectorized and not self._camera_gradient and not self.options.has_normals:
            self._project_backward = self._launch(
                project_backward_group_kernel,
                -(-len(self.gaussians) // GROUP_SIZE),
                [*pulled, layout.absolute, *self.gradients.arrays, *statistics.arrays],
                even=True,
            )
        else:
            self._project_backward = self._launch(
                project_backward_kernel,
                len(self.gaussians),
                [*pulled, layout.normal, layout.absolute]
                + [*self.gradients.arrays, self._camera_shares.array, *statistics.arrays],
                even=True,
            )
        if not self.vectorized:
            return
        self._forward = self._launch(
            forward_kernel(self.options),
            self._max_tiles,
            [*self._raster_inputs(), self._background, self._filled, *self._raster_outputs()]
            + [lists.pair_blocks],
        )
        self._backward = self._launch(
            backward_kernel(self.options, layout.absolute >= 0),
            self._max_tiles,
            [*self._raster_inputs(), *self._raster_outputs(), *self._adjoints()]
            + [lists.pair_blocks, lists.tile_pairs, lists.pair_gradients],
        )

    def _raster_inputs(self) -> list[Any]:
        lists, image = self.binner.lists, self.image
        layout = [image.pitch, image.plane, image.origin]
        splats = [lists.splats, lists.depths, self._normals]
        return [self._views, *layout, *splats, lists.tile_starts, lists.tile_splats]

    def _raster_outputs(self) -> list[wp.array]:
        planes = self.image, self.transmittance, self.depth, self.normals
        return [*(p.data for p in planes), self._stops]

    def _adjoints(self) -> list[wp.array]:
        planes = self.adj_image, self.adj_transmittance, self.adj_depth, self.adj_normals
        return [p.data for p in planes]

    def _forward_per_pixel(self) -> None:
        arguments = [*self._raster_inputs(), self._background, *self._raster_outputs()]
        self._per_pixel.forward(self.image, self.binner.tiles, arguments)

    def _backward_per_pixel(self) -> None:
        lists = self.binner.lists
        arguments = [*self._raster_inputs(), *self._raster_outputs(), *self._adjoints()]
        pairs = lists.tile_pairs, lists.pair_gradients
        self._per_pixel.backward(self.image, self.binner.tiles, arguments, pairs, self._layout)

    def _add_background(self, behind: ImagePlanes) -> None:
        image = self.image
        if (behind.pitch, behind.plane, behind.channels) != (image.pitch, image.plane, 3):
            raise ValueError(
                f"background of {behind.max_width}x{behind.max_height} px with {behind.channels} "
                f"channels, renderer of {image.max_width}x{image.max_height} px and 3 channels"
            )
        layout = [image.pitch, image.plane, image.origin]
        self._launch(
            add_background_kernel,
            image.max_height,
            [self._views, *layout, self.transmittance.data, behind.data, image.data],
        ).run()

    def _launch(
        self, kernel: Any, dim: int, inputs: list[Any], even: bool = False
    ) -> ParallelLaunch:
        return ParallelLaunch(kernel, dim, inputs, self.device, self.threads, even)
