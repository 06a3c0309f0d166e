"""Render Gaussians: project -> bin -> rasterize, and back, in buffers that are allocated once.

The trainer's tier; `digs_warp.splat.render.render` takes and returns NumPy values.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import warp as wp

from digs_warp.checks import check_finite, check_positive, check_shape
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import packed, put
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import PixelBox
from digs_warp.splat.backend import RasterBackend, RasterJob, backend_for
from digs_warp.splat.bin_tiles import TileBinner, tiles_with_background
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.config import DEFAULT_OPTIONS, RasterOptions
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.splat.footprint import ViewParams, view_params
from digs_warp.splat.records import (
    COLOR_FIELDS,
    PairGradients,
    Splats,
    TilePairs,
    ViewPlanes,
)

WHITE = (1.0, 1.0, 1.0)


class SplatRenderer:
    """Renders views of one set of Gaussians, and pulls image gradients back to them.

    Args:
        gaussians: the parameters; their contents may change between calls, the arrays only by
            `set_gaussians`.
        width: width of the largest view [px].
        height: height of the largest view [px].
        options: how splats are drawn, and what a view gives. The filter on the screen that the Gaussians are
            made for is added.
        backend: which kernels draw. Default: those for the device.
        adjoint_of: a renderer of the same size and options, or more outputs, whose ``adj_`` planes this one
            reads, too. Default: it has its own.
        threads: CPU threads; 0 means all cores. The result does not depend on it.

    After `forward`, ``image``, ``transmittance``, and where ``options`` ask for it ``depth`` (channels:
    expected, and unless only the mean is asked for, median; 0 where there is none) hold the view. Put the
    gradients of a loss into ``adj_image``, ``adj_transmittance`` and ``adj_depth`` (of the expected depth),
    call `backward`, and find dL/dparameter in ``gradients``.
    """

    def __init__(
        self,
        gaussians: DeviceGaussians,
        width: int,
        height: int,
        *,
        options: RasterOptions = DEFAULT_OPTIONS,
        backend: RasterBackend | None = None,
        adjoint_of: "SplatRenderer | None" = None,
        threads: int = 0,
    ) -> None:
        device = gaussians.device
        self.device = device
        self._asked = self.options = options
        self.backend = backend or backend_for(device)
        self.threads = self.backend.threads(threads)

        def planes(channels: int, wanted: bool = True) -> ImagePlanes:
            return ImagePlanes(width, height, channels if wanted else 0, device)

        self.image = planes(3)
        self.transmittance = planes(1)
        self.depth = planes(options.depth_channels)
        self.adj_image = adjoint_of.adj_image if adjoint_of else planes(3)
        self.adj_transmittance = adjoint_of.adj_transmittance if adjoint_of else planes(1)
        self.adj_depth = planes(1, options.has_depth)
        self._drawn = ViewPlanes(self.image, self.transmittance, self.depth)
        self._adjoint = ViewPlanes(self.adj_image, self.adj_transmittance, self.adj_depth)
        self._views = wp.zeros(1, dtype=ViewParams, device=device)  # pyright: ignore[reportArgumentType]
        self._background = wp.zeros(3, dtype=float, device=device)
        self._filled = wp.zeros(4, dtype=int, device=device)
        self._statistics: SplatStatistics | None = None
        self.set_gaussians(gaussians)

    def set_gaussians(self, gaussians: DeviceGaussians) -> None:
        """Render other Gaussians from now on, of any number; the planes stay.

        ``gradients`` becomes a new object, and ``statistics`` are switched off.
        """
        self.gaussians = gaussians
        self.gradients = gaussians.zeros_like()
        made_for = gaussians.screen_filter
        self.options = replace(
            self._asked,
            dilation=max(self._asked.dilation, made_for.dilation),
            antialias=self._asked.antialias or made_for.antialias,
        )
        self._statistics = None
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
        self._statistics = statistics
        self._generation = -1

    def forward(
        self,
        camera: Camera,
        *,
        near: float,
        background: tuple[float, float, float] | np.ndarray = WHITE,
        sh_degree: int | None = None,
        content: PixelBox | None = None,
        rows: RowMotion | None = None,
    ) -> None:
        """Render one view into ``image``, ``transmittance`` and what else the options ask for.

        Args:
            camera: its image is at most as large as the renderer's; all planes take its size.
            near: Gaussians whose center is nearer than this [m] are not drawn.
            background: sRGB color behind the Gaussians, shape (3,).
            sh_degree: bands of the color to use; default: all that the Gaussians have.
            content: pixels that are looked at although no splat may be there. Tiles without splats that lie
                more than `FILLED_AROUND` tiles (`digs_warp.splat.bin_tiles`) outside of the box of these
                and of all splats keep what they held: most of the image, when a single object is trained.
                Default: the whole image.
            rows: how the camera moves while the rows are read; ``camera`` is then that of the middle row.
                Default: it does not.

        Raises:
            ValueError: the camera's image does not fit the renderer.
            DigsError: the near plane is not above 0, or the background color is not finite.
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
        put(self._views, view_params(camera, near, self.options, rows))
        color = np.asarray(background, dtype=np.float32)
        put(self._background, check_finite("background", check_shape("background", color, (3,))))
        self._record(self._degree_of(sh_degree))
        self._launches.project()
        self.binner.bin()
        self._record(self._degree)  # its buffers may have grown
        if self.backend.skips_empty_tiles:
            boxes = None if content is None else [self.binner.drawn_box(), content]
            filled = tiles_with_background(boxes, self.binner.columns, self.binner.rows)
            put(self._filled, filled)
        self._launches.forward()

    def backward(self) -> None:
        """Fill ``gradients`` from the ``adj_`` planes for the last `forward`."""
        self._launches.backward()
        self._launches.project_backward()

    def stages(self) -> dict[str, Callable[[], object]]:
        """Return the stages of the last view by name, each ready to run again: for profiling."""
        return {
            "project": self._launches.project,
            "bin": self.binner.bin,
            "forward": self._launches.forward,
            "backward": self._launches.backward,
            "gather and project back": self._launches.project_backward,
        }

    def _make_binner(self) -> None:
        image = self.image
        self.binner = TileBinner(
            len(self.gaussians),
            image.max_width,
            image.max_height,
            self._views,
            COLOR_FIELDS + self.options.has_depth,
            self.threads,
        )
        self._max_tiles = self.binner.tiles
        ends = self.backend.ends(self._max_tiles, image.plane)
        self._ends = wp.zeros(ends, dtype=int, device=self.device)
        self.binner.resize(image.width, image.height)
        self._degree = -1
        self._generation = -1

    def _resize(self, width: int, height: int) -> None:
        self._drawn.resize(width, height)
        self._adjoint.resize(width, height)
        self.binner.resize(width, height)

    def _degree_of(self, wanted: int | None) -> int:
        """Return the bands of the color to use: as many as wanted and there."""
        there = round(self.gaussians.sh.shape[1] ** 0.5) - 1
        return there if wanted is None else min(there, wanted)

    def _record(self, degree: int) -> None:
        """Record the launches for ``degree`` bands and the present buffers, unless they are recorded."""
        if (degree, self.binner.generation) == (self._degree, self._generation):
            return
        self._degree, self._generation = degree, self.binner.generation
        lists = self.binner.lists
        statistics = self._statistics or SplatStatistics.zeros(0, self.device)
        job = RasterJob(
            device=self.device,
            threads=self.threads,
            depths=self.options.depth_channels,
            count=len(self.gaussians),
            tiles=self._max_tiles,
            degree=degree,
            gaussians=self.gaussians.for_kernels(),
            gradients=self.gradients.for_kernels(),
            splats=packed(
                Splats,
                views=self._views,
                records=lists.splats,
                centers=lists.centers,
                depths=lists.depths,
                boxes=lists.boxes,
            ),
            pairs=packed(
                TilePairs,
                starts=lists.tile_starts,
                members=lists.pairs,
                blocks=lists.pair_blocks,
            ),
            pair_gradients=packed(
                PairGradients, starts=lists.pair_starts, records=lists.pair_gradients
            ),
            background=self._background,
            filled=self._filled,
            drawn=self._drawn.for_kernels(),
            ends=self._ends,
            adjoint=self._adjoint.for_kernels(),
            statistics=statistics.for_kernels(),
        )
        self._launches = self.backend.record(job)
