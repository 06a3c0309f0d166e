"""What an eye sees at its pixel centers."""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.camera.shutter import ShutteredEye
from digs_warp.sim.render.protocol import CameraTrack


@dataclass(frozen=True, eq=False)
class Seen:
    """Surfaces in the middle of each row's exposure.

    Attributes:
        track: the eye: one pose for each band of rows.
        depth: planar z [m], (height, width), float32.
        material_ids: (height, width), int32; -1: the surround.
    """

    track: CameraTrack
    depth: np.ndarray
    material_ids: np.ndarray

    @staticmethod
    def by(eye: ShutteredEye) -> "Seen":
        """Return what an eye sees."""
        seen = eye.geometry()
        return Seen(eye.middle_track, seen.depth, seen.material_ids)
