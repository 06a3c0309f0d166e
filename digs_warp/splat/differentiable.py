"""Splat rasterization as one function that a `wp.Tape` differentiates.

    gaussians = DeviceGaussians.from_numpy(seeds, requires_grad=True)
    with wp.Tape() as tape:
        view = rasterize(tape, gaussians, camera)
        wp.launch(my_loss_kernel, dim=..., inputs=[view.image, target], outputs=[loss])
    tape.backward(loss)
    gaussians.means.grad  # dL/dmeans

Every call allocates what it needs; a training loop uses `digs_warp.splat.renderer.SplatRenderer`, which does
not. On a CUDA device the same function runs kernels with a block of threads per tile.
"""

from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.splat.camera_motion import moved_camera, pose_gradient
from digs_warp.splat.config import DEFAULT_OPTIONS, MEDIAN, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.plane_kernels import add_kernel, pack_planes_kernel, unpack_planes_kernel
from digs_warp.splat.render import draw
from digs_warp.splat.renderer import WHITE, SplatRenderer


@dataclass(frozen=True, eq=False)
class RasterizedView:
    """What `rasterize` returns: float32 arrays on the device of the Gaussians.

    Attributes:
        image: sRGB, shape (height, width, 3), not clipped above.
        alpha: coverage in 0..1, shape (height, width, 1).
        depth: expected planar depth [m], 0 where nothing is drawn, (height, width, 1); None unless asked for.
        median_depth: depth [m] at which the coverage passes 1/2, 0 where it does not, (height, width, 1);
            None unless asked for. It has no gradient.
        normals: sum of the weighted unit normals, camera axes, (height, width, 3); None unless asked for.
    """

    image: wp.array
    alpha: wp.array
    depth: wp.array | None = None
    median_depth: wp.array | None = None
    normals: wp.array | None = None


@dataclass(frozen=True, eq=False)
class _Output:
    """One output: scale * plane + offset; its gradient times ``scale`` goes back into ``adjoint``."""

    pixels: wp.array
    adjoint: ImagePlanes
    scale: float


def rasterize(
    tape: wp.Tape | None,
    gaussians: DeviceGaussians,
    camera: Camera,
    *,
    pose: wp.array | None = None,
    intrinsics: wp.array | None = None,
    near: float | None = None,
    background: tuple[float, float, float] | np.ndarray = WHITE,
    options: RasterOptions = DEFAULT_OPTIONS,
) -> RasterizedView:
    """Draw Gaussians; with a tape, its backward pass adds dL/d(input) to ``.grad`` of the inputs.

    Args:
        tape: the tape that records the caller's kernels; None: no gradients.
        gaussians: what to draw. Arrays made with ``requires_grad`` receive gradients.
        camera: from where.
        pose: motion of the camera in its own frame, shape (6,), float32: a rotation vector w [rad] and a
            translation t [m]; the view is that of ``world_from_cam @ [[R(w), t], [0, 1]]``. Default: none.
        intrinsics: fx, fy, cx, cy [px] in place of the camera's, shape (4,), float32.
        near: near plane [m]; default: a share of the distance to the middle of the Gaussians.
        background: sRGB color, shape (3,), or image, shape (height, width, 3).
        options: how splats are drawn, and whether depth and normals are wanted.

    Raises:
        DigsError: pose, intrinsics or background have another shape, or the camera cannot be.
    """
    moved = moved_camera(camera, _to_numpy(pose), _to_numpy(intrinsics))
    k = moved.intrinsics
    renderer = SplatRenderer(
        gaussians,
        k.width,
        k.height,
        options=options,
        camera_gradient=pose is not None or intrinsics is not None,
    )
    draw(renderer, moved, near, background)
    image = _output(renderer.image, renderer.adj_image)
    alpha = _output(renderer.transmittance, renderer.adj_transmittance, scale=-1.0, offset=1.0)
    outputs = [image, alpha]
    view = RasterizedView(image.pixels, alpha.pixels)
    if options.has_depth:
        depth = _output(renderer.depth, renderer.adj_depth, channels=1)
        outputs.append(depth)
        view = replace(view, depth=depth.pixels)
    if options.depth_channels > MEDIAN:
        median = _output(renderer.depth, renderer.adj_depth, channels=1, first=MEDIAN)
        view = replace(view, median_depth=median.pixels)
    if options.has_normals:
        normals = _output(renderer.normals, renderer.adj_normals)
        outputs.append(normals)
        view = replace(view, normals=normals.pixels)
    if tape is not None:
        _record(tape, renderer, outputs, pose, intrinsics)
    return view


def _output(
    planes: ImagePlanes,
    adjoint: ImagePlanes,
    *,
    channels: int = 0,
    first: int = 0,
    scale: float = 1.0,
    offset: float = 0.0,
) -> _Output:
    """Copy some channels of planes into a new array."""
    shape = (planes.height, planes.width, channels or planes.channels)
    device = str(planes.data.device)
    pixels = wp.zeros(shape, dtype=float, device=device, requires_grad=True)
    layout = [planes.pitch, planes.plane, planes.origin + first * planes.plane]
    inputs = [*layout, planes.data, scale, offset, pixels]
    launch_parallel(unpack_planes_kernel, planes.height, inputs, device)
    return _Output(pixels, adjoint, scale)


def _record(
    tape: wp.Tape,
    renderer: SplatRenderer,
    outputs: list[_Output],
    pose: wp.array | None,
    intrinsics: wp.array | None,
) -> None:
    """Make the tape call the renderer's backward pass."""
    device = renderer.device
    inputs = [a for a in (*renderer.gaussians.arrays, pose, intrinsics) if a is not None]

    def backward() -> None:
        for output in outputs:
            planes = output.adjoint
            layout = [planes.pitch, planes.plane, planes.origin]
            arguments = [*layout, output.pixels.grad, output.scale, planes.data]
            launch_parallel(pack_planes_kernel, planes.height, arguments, device)
        renderer.backward()
        pairs = zip(renderer.gaussians.arrays, renderer.gradients.arrays, strict=True)
        for array, gradient in pairs:
            _add(gradient, array.grad)
        if pose is not None or intrinsics is not None:
            gradient = renderer.camera_gradient()
            if pose is not None:
                _add_numpy(pose_gradient(gradient, pose.numpy()), pose.grad)
            if intrinsics is not None:
                _add_numpy(np.concatenate([gradient.focal, gradient.center]), intrinsics.grad)

    differentiable = [array for array in inputs if array.grad is not None]
    tape.record_func(backward, [*differentiable, *(output.pixels for output in outputs)])


def _to_numpy(array: wp.array | None) -> np.ndarray | None:
    return None if array is None else array.numpy()


def _add_numpy(values: np.ndarray, target: wp.array | None) -> None:
    if target is not None:
        _add(wp.array(values, dtype=float, device=target.device), target)


def _add(source: wp.array, target: wp.array | None) -> None:
    """Add one array of floats or vectors to another; a target of None wants nothing."""
    if target is None or target.size == 0:
        return
    flat = [array.view(wp.float32).flatten() for array in (source, target)]
    wp.launch(
        add_kernel,
        dim=flat[0].size,
        inputs=flat,
        device=target.device,
        record_tape=False,
    )
