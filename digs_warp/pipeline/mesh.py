"""A mesh of Gaussians from the cameras that saw them, and from measured depth as far as that is trusted.

The photographs tell how far, as they do in the training (`digs_warp.train.depth_errors`): where whole regions
of the measured depth lie off the surface of the Gaussians, that surface is the better one. Where only single
pixels do, measured depth is as good as it, and its errors are others: together they are better than each.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.pipeline.records import Poses
from digs_warp.show.film.camera_path import Subject, find_subject, orbit
from digs_warp.surface.depth_views import depth_views
from digs_warp.surface.extract import OBJECT_THRESHOLD, Layers, Scene, extract_surface
from digs_warp.train.depth_errors import (
    TRUSTED_IN_SCENES,
    TRUSTED_SPREAD,
    DepthErrors,
    DepthJudge,
    cells_of,
    depth_samples,
)

# More cameras add little and take longer.
MOST_VIEWS = 60

# Without a capture: rings of cameras at these elevations [degrees].
RING_ELEVATIONS_DEG = (-15.0, 15.0, 45.0, 70.0)
RING_CAMERAS = 16
RING_SIZE_PX = 512
RING_FOV_DEG = 45.0

# The trust hardly changes with more views.
VIEWS = 8
# Depth that is trusted less is left out: its errors are larger than those of the Gaussians.
LEAST_TRUST = 0.5


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

    mesh: TriangleMesh
    removed_parts: int
    removed_triangles: int
    views: int
    voxel: float
    has_depth: bool
    trust: float


def extract_mesh(
    gaussians: Gaussians, poses: Poses, voxel: float | None = None, views: int = MOST_VIEWS
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


def _chosen(frames: PosedFrames | None, views: int) -> list[Frame]:
    return [] if frames is None else evenly((*frames.training, *frames.held_out), views)


def _rings(scene: Scene) -> list[Camera]:

    k = Intrinsics.from_fov(RING_SIZE_PX, RING_SIZE_PX, RING_FOV_DEG)
    subject = Subject(scene.center_world, scene.radius)
    rings = [orbit(subject, k, RING_CAMERAS, elevation) for elevation in RING_ELEVATIONS_DEG]
    return [camera for ring in rings for camera in ring]


@dataclass(frozen=True, eq=False)
class MeasuredDepth:
    """What is fused beside the rendered depth.

    Attributes:
        load: reads the depth of each frame without its offset [m], NaN where unknown.
        trust: in it, `LEAST_TRUST` to 1.
    """

    load: Layers
    trust: float


def measured_depth(
    gaussians: Gaussians, frames: Sequence[Frame], center_world: np.ndarray, is_object: bool
) -> MeasuredDepth | None:
    """Return the measured depth of frames; None where one has none, or it is not trusted.

    Args:
        gaussians: what was reconstructed from the frames.
        frames: as posed.
        center_world: where the scene is [m].
        is_object: whether the Gaussians are of one object, trained with masks.
    """
    if not frames or not all(frame.has(Layer.DEPTH) for frame in frames):
        return None
    errors = _errors(gaussians, evenly(frames, VIEWS), center_world, is_object)
    if errors.trust < LEAST_TRUST:
        return None
    return MeasuredDepth([partial(_loaded, f, errors.offset) for f in frames], errors.trust)


def _errors(
    gaussians: Gaussians, frames: Sequence[Frame], center_world: np.ndarray, is_object: bool
) -> DepthErrors:
    judge = DepthJudge(len(frames), TRUSTED_SPREAD if is_object else TRUSTED_IN_SCENES)
    cameras = [frame.camera for frame in frames]
    views = depth_views(gaussians, cameras, center_world, is_object=is_object)
    for number, (view, frame) in enumerate(zip(views, frames, strict=True)):
        measured = frame.load_depth()
        known = np.isfinite(measured) & np.isfinite(view.depth)
        if frame.has(Layer.MASK):
            known &= frame.load_mask() > OBJECT_THRESHOLD
        samples = depth_samples(measured, known)
        rendered = view.depth[samples.rows, samples.columns].astype(np.float64)
        judge.fit(number, rendered, samples.values, cells_of(samples))
    return judge.errors


def _loaded(frame: Frame, offset: float) -> np.ndarray:
    measured = frame.load_depth()
    return measured / np.maximum(1.0 - offset * measured, 0.1)
