"""Frames with the errors of `--poses perturbed`, where no images are matched."""

from collections.abc import Sequence
from dataclasses import replace

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.poses.from_images.config import SfmConfig


def perturbed(frames: PosedFrames, capture: Capture, config: SfmConfig) -> PosedFrames:
    """Return the frames, each turned and moved by the error that it also has where images are matched."""
    from digs_warp.poses.from_images.perturb import perturbed_poses

    given = [frame.camera.world_from_cam for frame in capture.frames]
    sizes = config.rotation_error_deg, config.translation_error
    names = [frame.name for frame in capture.frames]
    poses = dict(zip(names, perturbed_poses(given, *sizes, config.sfm_seed), strict=True))

    def posed(some: Sequence[Frame]) -> tuple[Frame, ...]:
        return tuple(
            replace(f, camera=replace(f.camera, world_from_cam=poses[f.name])) for f in some
        )

    return replace(frames, training=posed(frames.training), held_out=posed(frames.held_out))
