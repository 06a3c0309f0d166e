"""Frames of a simulated recording one after the other, for programs that consume them at once."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.sim.config import SimulateConfig


@dataclass(frozen=True, eq=False)
class StereoFrame:
    """What the simulated stereo depth camera gives at one moment, and the truth.

    Attributes:
        number: index of the frame, from 0.
        time: seconds since the start.
        camera: the left camera, or the color camera beside an infrared pair.
        left: its image, sRGB, shape (height, width, 3), uint8.
        right: the right image, the same; None beside an infrared pair.
        depth: sensed planar depth [m], shape (height, width), float32, NaN where unknown.
        depth_true: true planar depth [m], the same.
        mask: the object, 0 to 255, shape (height, width), uint8.
        cause: why depth is missing or wrong (`digs_warp.sim.sensor.frame.Cause`), (height, width), uint8;
            None for the tiers 'truth' and 'law', which do not know.
        infrared: left and right infrared image, each (height, width), uint8; None without such a pair.
    """

    number: int
    time: float
    camera: Camera
    left: np.ndarray
    right: np.ndarray | None
    depth: np.ndarray
    depth_true: np.ndarray
    mask: np.ndarray
    cause: np.ndarray | None
    infrared: tuple[np.ndarray, np.ndarray] | None = None


def stream(config: SimulateConfig) -> Iterator[StereoFrame]:
    """Yield the frames of a recording; each is rendered when asked for, none is kept.

    Raises:
        DigsError: bad input.
    """
    from digs_warp.sim.record.frame_maker import FrameMaker  # here: the class above needs no Warp

    maker = FrameMaker.of(config)
    session = maker.session
    for number, moment in enumerate(session.moments):
        images = maker.finish(maker.render(number), {})
        camera = Camera(session.rig.image_intrinsics, session.walk.pose(moment))
        frame = Frame(f"{number:04d}", camera, moment, images.by_layer())
        yield StereoFrame(
            number=number,
            time=moment,
            camera=camera,
            left=frame.load_image(),
            right=frame.load_right_image() if frame.has(Layer.RIGHT) else None,
            depth=frame.load_depth(),
            depth_true=frame.load_depth_true(),
            mask=frame.load_mask(),
            cause=frame.load_cause() if frame.has(Layer.CAUSE) else None,
            infrared=frame.load_infrared() if frame.has(Layer.INFRARED_LEFT) else None,
        )
