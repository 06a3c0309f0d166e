"""The same recording of a larger or smaller world: the images stay, lengths grow by a factor."""

from dataclasses import replace

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import rigid


def larger(frame: Frame, factor: float) -> Frame:
    pose = frame.camera.world_from_cam
    camera = Camera(frame.camera.intrinsics, rigid(pose[:3, :3], factor * pose[:3, 3]))
    depth = (factor * frame.load_depth()).astype(np.float32)
    return replace(frame, camera=camera).with_layer(Layer.DEPTH, depth)
