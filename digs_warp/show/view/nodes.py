"""Puts contents into the scene of a page: one node for each thing that can be shown or hidden.

Cameras show the photograph, the measured depth, or why depth is missing.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, quat_xyzw_from_matrix
from digs_warp.geometry.sh import C0
from digs_warp.show.report.causes import paint_causes
from digs_warp.show.view.placement import RADIUS, Placement
from digs_warp.show.view.streamer import painted_depth

if TYPE_CHECKING:
    import viser


Picture = Literal["photograph", "measured depth", "why depth is missing", "nothing"]

LAYERS: dict[Picture, Layer] = {
    "photograph": Layer.IMAGE,
    "measured depth": Layer.DEPTH,
    "why depth is missing": Layer.CAUSE,
}

# Width of a picture in a camera [px].
WIDTH = 240


def pictures_of(frames: tuple[Frame, ...]) -> list[Picture]:
    """Return what the cameras can show, for at least one of the frames."""
    known: list[Picture] = [
        name for name, layer in LAYERS.items() if any(frame.has(layer) for frame in frames)
    ]
    return [*known, "nothing"]


def load_picture(frame: Frame, picture: Picture) -> np.ndarray | None:
    """Return a small picture, (height, width, 3), uint8; None where the frame does not have it.

    Raises:
        CaptureError: its image cannot be read.
    """
    if picture == "nothing" or not frame.has(LAYERS[picture]):
        return None
    if picture == "photograph":
        full = frame.load_image()
    elif picture == "measured depth":
        depth = frame.load_depth()
        full = painted_depth(depth, np.isfinite(depth) & (depth > 0))
    else:
        causes = frame.load_cause()
        full = paint_causes(causes, max(1, causes.shape[1] // WIDTH))
    step = max(1, full.shape[1] // WIDTH)
    return np.ascontiguousarray(full[::step, ::step])


Scene: TypeAlias = "viser.SceneApi"

# What can be shown beside points and meshes, which have names of their own.
GAUSSIANS, CAMERAS = "gaussians", "cameras"

# Cameras that are drawn, and the length of one [page units].
MOST_CAMERAS, CAMERA_LENGTH = 60, 0.06 * RADIUS

POINT_SIZE = 0.004 * RADIUS


def add_gaussians(scene: Scene, name: str, page: Gaussians) -> "viser.SceneNodeHandle":
    """Add Gaussians that are already on the page, in their base color."""
    axes = matrix_from_quat_xyzw(page.quats) * page.scales[:, None, :]
    return scene.add_gaussian_splats(
        name,
        centers=page.means,
        covariances=(axes @ axes.swapaxes(1, 2)).astype(np.float32),
        rgbs=np.clip(0.5 + C0 * page.sh[:, 0], 0.0, 1.0),
        opacities=page.opacities[:, None],
    )


def add_points(
    scene: Scene, name: str, cloud: PointCloud, placement: Placement
) -> "viser.SceneNodeHandle":
    """Add colored points."""
    points = placement.points(cloud.points_world)
    colors = to_uint8(cloud.colors)
    return scene.add_point_cloud(
        name, points, colors, point_size=POINT_SIZE, precision="float32", point_shading="flat"
    )


def add_mesh(
    scene: Scene, name: str, mesh: TriangleMesh, placement: Placement
) -> "viser.SceneNodeHandle":
    """Add a surface with the colors of its vertices."""
    import trimesh

    colored = trimesh.Trimesh(
        placement.points(mesh.points_world),
        mesh.triangles,
        vertex_colors=to_uint8(mesh.colors),
        process=False,
    )
    return scene.add_mesh_trimesh(name, colored)


def add_cameras(
    scene: Scene,
    name: str,
    frames: tuple[Frame, ...],
    picture: Picture,
    placement: Placement,
    on_click: Callable[["viser.ClientHandle", Frame], None],
) -> list["viser.SceneNodeHandle"]:
    """Add at most `MOST_CAMERAS` cameras with their pictures; a click on one calls ``on_click``."""
    handles: list[viser.SceneNodeHandle] = []
    for frame in evenly(frames, MOST_CAMERAS):
        k = frame.camera.intrinsics
        pose = frame.camera.world_from_cam
        handle = scene.add_camera_frustum(
            f"{name}/{frame.name}",
            fov=2.0 * float(np.arctan(0.5 * k.height / k.fy)),
            aspect=k.width / k.height,
            scale=CAMERA_LENGTH,
            image=load_picture(frame, picture),
            wxyz=np.roll(quat_xyzw_from_matrix(pose[:3, :3]), 1),
            position=placement.points(pose[None, :3, 3])[0],
        )

        @handle.on_click
        def _(event: "viser.SceneNodePointerEvent", frame: Frame = frame) -> None:
            on_click(event.client, frame)

        handles.append(handle)
    return handles
