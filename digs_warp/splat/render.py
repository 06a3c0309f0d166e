"""Render Gaussians: project -> bin -> rasterize, and back.

Two tiers: `SplatRenderer` holds every buffer for images of one size and allocates nothing per view (the
trainer's tier); `render` takes and returns NumPy values.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.gaussians import Gaussians
from digs_warp.image_planes import ImagePlanes
from digs_warp.parallel import ParallelLaunch, default_threads
from digs_warp.splat.bin_tiles import TileBinner
from digs_warp.splat.config import NEAR_SHARE
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import CameraParams, camera_params
from digs_warp.splat.project import project_backward_kernel, project_kernel
from digs_warp.splat.rasterize import backward_kernel, forward_kernel
from digs_warp.splat.rasterize_reference import (
    backward_reference_kernel,
    forward_reference_kernel,
)

WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class RenderOutput:
    """One rendered view.

    Attributes:
        image: sRGB, shape (height, width, 3), float32, not clipped above.
        alpha: coverage in 0..1, shape (height, width), float32.
    """

    image: np.ndarray
    alpha: np.ndarray


def near_plane(camera: Camera, scene_center: np.ndarray) -> float:
    """Return the near plane [m]: a share of the distance to the scene, so that units do not matter."""
    return max(1e-6, NEAR_SHARE * float(np.linalg.norm(camera.center_world - scene_center)))


class SplatRenderer:
    """Renders views of one size of one set of Gaussians, and pulls image gradients back to them.

    Args:
        gaussians: the parameters; their contents may change between calls, the arrays may not.
        width, height: image size [px].
        vectorized: the fast CPU kernels; False: the thread-per-pixel twin. Default: by device.
        threads: CPU threads; 0 means all cores. The result does not depend on it.

    After `forward`, ``image`` and ``transmittance`` hold the view. Put dL/dimage and dL/dtransmittance
    into ``adj_image`` and ``adj_transmittance``, call `backward`, and find dL/dparameter in ``gradients``.
    """

    def __init__(
        self,
        gaussians: DeviceGaussians,
        width: int,
        height: int,
        *,
        vectorized: bool | None = None,
        threads: int = 0,
    ) -> None:
        device = gaussians.device
        self.gaussians = gaussians
        self.device = device
        self.vectorized = device == "cpu" if vectorized is None else vectorized
        # The twin's atomics are plain additions on a CPU: one thread.
        self.threads = (threads or default_threads()) if self.vectorized else 1
        self.gradients = gaussians.zeros_like()
        self.image = ImagePlanes(width, height, 3, device)
        self.transmittance = ImagePlanes(width, height, 1, device)
        self.adj_image = ImagePlanes(width, height, 3, device)
        self.adj_transmittance = ImagePlanes(width, height, 1, device)
        self.binner = TileBinner(
            len(gaussians), width, height, device, self.threads, counting=self.vectorized
        )
        self._camera = wp.zeros(1, dtype=CameraParams, device=device)  # pyright: ignore[reportArgumentType]
        self._background = wp.zeros(3, dtype=float, device=device)
        stops = self.binner.tiles if self.vectorized else self.image.plane
        self._stops = wp.zeros(stops, dtype=int, device=device)
        self._degree = -1
        self._generation = -1

    def forward(
        self,
        camera: Camera,
        *,
        near: float,
        background: tuple[float, float, float] | np.ndarray = WHITE,
        sh_degree: int | None = None,
    ) -> None:
        """Render one view into ``image`` and ``transmittance``.

        Args:
            camera: its image size must be the renderer's.
            near: Gaussians whose centre is nearer than this [m] are not drawn.
            background: sRGB colour behind the Gaussians.
            sh_degree: bands of the colour to use; default: all that the Gaussians have.
        """
        k = camera.intrinsics
        if (k.width, k.height) != (self.image.width, self.image.height):
            raise ValueError(
                f"camera of {k.width}x{k.height} px, renderer of "
                f"{self.image.width}x{self.image.height} px"
            )
        self._camera.assign(camera_params(camera, near))
        self._background.assign(np.asarray(background, dtype=np.float32))
        all_bands = round(self.gaussians.sh.shape[1] ** 0.5) - 1
        degree = all_bands if sh_degree is None else min(sh_degree, all_bands)
        if degree != self._degree:
            self._record_projection(degree)
        self._project.run()
        self.binner.bin()
        if self.binner.generation != self._generation:
            self._record_rasterization()
        if self.vectorized:
            self._forward.run()
        else:
            self._forward_reference()

    def backward(self) -> None:
        """Fill ``gradients`` from ``adj_image`` and ``adj_transmittance`` for the last `forward`."""
        if self.vectorized:
            self._backward.run()
        else:
            self._backward_reference()
        self._project_backward.run()

    def stages(self) -> dict[str, Callable[[], object]]:
        """Return the stages of the last view by name, each ready to run again: for profiling."""
        return {
            "project": self._project.run,
            "bin": self.binner.bin,
            "forward": self._forward.run if self.vectorized else self._forward_reference,
            "backward": self._backward.run if self.vectorized else self._backward_reference,
            "gather and project back": self._project_backward.run,
        }

    def _record_projection(self, degree: int) -> None:
        """Record the launches that depend on the number of colour bands."""
        self._degree = degree
        lists = self.binner.lists
        outputs = [lists.splats, lists.depths, lists.first_tile_rows, lists.row_counts]
        self._project = self._launch(
            project_kernel,
            len(self.gaussians),
            [self._camera, *self.gaussians.arrays, degree, *outputs],
        )
        self._generation = -1

    def _record_rasterization(self) -> None:
        """Record the launches that hold the binner's growing buffers."""
        self._generation = self.binner.generation
        lists = self.binner.lists
        g = self.gaussians
        self._project_backward = self._launch(
            project_backward_kernel,
            len(g),
            [self._camera, g.means, g.log_scales, g.quats, g.sh, self._degree, lists.splats]
            + [lists.pair_starts, lists.pair_slots, lists.pair_gradients]
            + list(self.gradients.arrays),
        )
        if not self.vectorized:
            return
        image = self.image
        layout = [image.pitch, image.plane, image.origin]
        tiles = [lists.splats, lists.tile_starts, lists.tile_splats]
        self._forward = self._launch(
            forward_kernel,
            self.binner.tiles,
            [self.binner.columns, image.width, image.height, *layout, *tiles, self._background]
            + [image.data, self.transmittance.data, self._stops],
        )
        self._backward = self._launch(
            backward_kernel,
            self.binner.tiles,
            [self.binner.columns, *layout, *tiles, image.data, self.transmittance.data, self._stops]
            + [self.adj_image.data, self.adj_transmittance.data, lists.pair_gradients],
        )

    def _reference_inputs(self) -> list:
        lists, image = self.binner.lists, self.image
        layout = [self.binner.columns, image.pitch, image.plane, image.origin]
        return [*layout, lists.splats, lists.tile_starts, lists.tile_splats]

    def _forward_reference(self) -> None:
        wp.launch(
            forward_reference_kernel,
            dim=(self.image.height, self.image.width),
            inputs=[*self._reference_inputs(), self._background],
            outputs=[self.image.data, self.transmittance.data, self._stops],
            device=self.device,
        )

    def _backward_reference(self) -> None:
        self.binner.lists.pair_gradients.zero_()
        wp.launch(
            backward_reference_kernel,
            dim=(self.image.height, self.image.width),
            inputs=[*self._reference_inputs(), self.image.data, self.transmittance.data]
            + [self._stops, self.adj_image.data, self.adj_transmittance.data],
            outputs=[self.binner.lists.pair_gradients],
            device=self.device,
        )

    def _launch(self, kernel: Any, dim: int, inputs: list[Any]) -> ParallelLaunch:
        return ParallelLaunch(kernel, dim, inputs, self.device, self.threads)


def render(
    gaussians: Gaussians,
    camera: Camera,
    *,
    background: tuple[float, float, float] = WHITE,
    near: float | None = None,
    device: str = "cpu",
) -> RenderOutput:
    """Render one view; allocates its buffers, so use `SplatRenderer` for many.

    ``near`` defaults to a share of the distance to the middle of the Gaussians.
    """
    if near is None:
        center = gaussians.means.mean(axis=0) if len(gaussians) else np.zeros(3)
        near = near_plane(camera, center)
    k = camera.intrinsics
    renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians, device), k.width, k.height)
    renderer.forward(camera, near=near, background=background)
    alpha = 1.0 - renderer.transmittance.to_numpy()[..., 0]
    return RenderOutput(renderer.image.to_numpy(), alpha)
