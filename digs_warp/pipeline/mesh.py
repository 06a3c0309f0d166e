"""A mesh of Gaussians from the cameras that saw them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly

if TYPE_CHECKING:
    from digs_warp.data.frame import Frame
    from digs_warp.data.gaussians import Gaussians
    from digs_warp.data.posed_frames import PosedFrames
    from digs_warp.data.triangle_mesh import TriangleMesh
    from digs_warp.geometry.camera import Camera
    from digs_warp.pipeline.records import Poses
    from digs_warp.surface.extract import Scene

# More cameras add little and take longer.
MOST_VIEWS = 60

# Without a capture: rings of cameras at these elevations [degrees].
RING_ELEVATIONS_DEG = (-15.0, 15.0, 45.0, 70.0)
RING_CAMERAS = 16
RING_SIZE_PX = 512
RING_FOV_DEG = 45.0


@dataclass(frozen=True, eq=False)
class ExtractedMesh:
    """A mesh, and how it was made.

    Attributes:
        mesh: without floaters.
        removed_parts, removed_triangles: how many were removed as floaters.
        views: number of cameras used.
        voxel: the finest detail [m].
        has_depth: whether all frames of the recording have measured depth.
        trust: in the measured depth that was fused beside the rendered one; 0: it was not.
    """

    mesh: "TriangleMesh"
    removed_parts: int
    removed_triangles: int
    views: int
    voxel: float
    has_depth: bool
    trust: float


def extract_mesh(
    gaussians: "Gaussians", poses: "Poses", voxel: float | None = None, views: int = MOST_VIEWS
) -> ExtractedMesh:
    """Return the surface of Gaussians as seen by the cameras of their capture, or by rings of cameras.

    Args:
        gaussians: of one object, or of all in view.
        poses: which of the two; its frames, if known, have cameras and masks.
        voxel: finest detail [m]; default: a 160th of the object's size.
        views: the most cameras to use, evenly spread.

    Raises:
        DigsError: the cameras see no surface.
    """
    from digs_warp.pipeline.measured_depth import measured_depth
    from digs_warp.show.film.camera_path import find_subject
    from digs_warp.surface.extract import Scene, extract_surface

    subject = find_subject(gaussians)
    scene = Scene(subject.center_world, subject.radius)
    frames = _chosen(poses.frames, views)
    cameras = [f.camera for f in frames] or evenly(_rings(scene), views)
    masked = bool(frames) and all(frame.has(Layer.MASK) for frame in frames)
    is_object = poses.subject == "object"
    depth = measured_depth(gaussians, frames, scene.center_world, is_object)
    found = extract_surface(
        *(gaussians, cameras, scene, voxel),
        masks=[f.load_mask for f in frames] if masked else None,
        is_object=is_object,
        measured=depth.load if depth else None,
        trust=depth.trust if depth else 0.0,
    )
    return ExtractedMesh(
        found.mesh,
        found.removed_parts,
        found.removed_triangles,
        len(cameras),
        scene.voxel if voxel is None else voxel,
        bool(frames) and all(frame.has(Layer.DEPTH) for frame in frames),
        depth.trust if depth else 0.0,
    )


def _chosen(frames: "PosedFrames | None", views: int) -> "list[Frame]":
    return [] if frames is None else evenly((*frames.training, *frames.held_out), views)


def _rings(scene: "Scene") -> "list[Camera]":
    from digs_warp.geometry.camera import Intrinsics
    from digs_warp.show.film.camera_path import Subject, orbit

    k = Intrinsics.from_fov(RING_SIZE_PX, RING_SIZE_PX, RING_FOV_DEG)
    subject = Subject(scene.center_world, scene.radius)
    rings = [orbit(subject, k, RING_CAMERAS, elevation) for elevation in RING_ELEVATIONS_DEG]
    return [camera for ring in rings for camera in ring]
