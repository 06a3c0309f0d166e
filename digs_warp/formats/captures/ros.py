# rosbags is an extra that type checking need not have:
# pyright: reportMissingImports=false
"""Bags of robots and of RealSense cameras, by rosbags: color, depth, and a camera_info each.

ROS 1 and ROS 2, MCAP, and what RealSense Viewer writes (.bag, .db3). Topics of 16UC1 or 32FC1 are depth;
of the others color is preferred to gray, then the topic with the most images. A camera_info belongs to the
images whose topic has the longest common path with its own. Depth counts as registered to color ("aligned",
"registered") unless the bag has the extrinsics of both cameras, as RealSense bags do. Poses are not read.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from os.path import commonpath
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.images import MM_PER_METRE, depth_in_metres, write_image
from digs_warp.data.sharpness import Sharpness
from digs_warp.formats.captures.lens import Lens, undistorted
from digs_warp.formats.captures.recording import DepthCamera, RecordedFrame, Recording
from digs_warp.formats.captures.video import choose
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid, matrix_from_quat_xyzw, rigid

_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_INFO = "sensor_msgs/msg/CameraInfo"
_DEPTH = ("16UC1", "32FC1", "mono16")
# Type and channels of the pixels by their encoding.
_ENCODINGS = {
    **{"rgb8": ("u1", 3), "bgr8": ("u1", 3), "rgba8": ("u1", 4), "bgra8": ("u1", 4)},
    **{"mono8": ("u1", 1), "8UC1": ("u1", 1), "8UC3": ("u1", 3)},
    **{"16UC1": ("u2", 1), "mono16": ("u2", 1), "32FC1": ("f4", 1)},
}
# A depth image belongs to the color image nearest in time, at most this far [s]: half a frame at 15 Hz.
_APART = 0.035
# What comes before the PNG in a compressed depth image, and behind the images of librealsense [bytes].
_DEPTH_HEADER, _TAIL = 12, 4
# Lens models in ROS and in librealsense, which projects with its "inverse" one as with Brown's.
_BROWN = ("", "none", "plumb bob", "rational polynomial", "brown conrady", "inverse brown conrady")
_FISHEYE = ("equidistant", "kannala brandt4")


def read_ros(path: Path, scratch: Path, count: int) -> Recording:
    """Write the chosen frames of a recording to ``scratch``, and return them.

    Args:
        path: a .bag or .mcap file, or the folder of a ROS 2 bag.
        scratch: a folder that has to live as long as the recording.
        count: the most frames to take.
    """
    bag = _Bag(path)
    color, depth = bag.color, bag.depth
    measure = Sharpness()
    times, sharpness = [], []
    for time, message in bag.messages(color):
        times.append(time)
        sharpness.append(measure(_rgb(_pixels(message, path))))
    kept = {times[number] for number in choose(np.array(sharpness), count)}
    depths = {}
    if depth is not None:
        wanted = np.array(sorted(kept))
        for time, message in bag.messages(depth):
            nearest = float(wanted[np.abs(wanted - time).argmin()])
            if abs(nearest - time) <= _APART and nearest not in depths:
                depths[nearest] = scratch / f"depth{len(depths):06d}.exr"
                units = 1 / bag.metres_per_unit
                depth_m = depth_in_metres(_pixels(message, path), f"depth in '{path}'", units)
                write_image(depths[nearest], depth_m)
    k, lens = bag.camera(color)
    view = undistorted(k, lens)
    frames = []
    for time, message in bag.messages(color):
        if time not in kept:
            continue
        kept.remove(time)
        image = scratch / f"color{len(frames):06d}.png"
        write_image(image, _rgb(_pixels(message, path)))
        frames.append(RecordedFrame(image, k, time, depth=depths.get(time), view=view))
    own = None if depth is None or bag.infos.get(depth) is None else bag.camera(depth)[0]
    color_from_depth = bag.color_from_depth()
    is_registered = own in (None, k) and color_from_depth is None
    depth_camera = None if is_registered else DepthCamera(own or k, color_from_depth)
    return Recording(path, tuple(frames), depth_camera=depth_camera)


class _Bag:
    """The topics of a bag that are read: ``color``, ``depth`` or None, and ``infos`` by topic of images."""

    def __init__(self, path: Path) -> None:
        try:
            from rosbags.highlevel import AnyReader, AnyReaderError
            from rosbags.typesys import Stores, get_typestore
        except ModuleNotFoundError as error:
            raise CaptureError(
                f"'{path}': bags need rosbags: pip install 'digs-warp[ros]'"
            ) from error
        self._path, self._broken = path, AnyReaderError
        self._open = lambda: AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        self.metres_per_unit = 1 / MM_PER_METRE
        images, infos = {}, {}
        self._places: dict[str, np.ndarray] = {}
        with self._opened() as reader:
            for connection in reader.connections:
                topic = connection.topic
                wanted = connection.msgtype in (*_IMAGES, _INFO) or "/tf/" in topic
                if not connection.msgcount or not (wanted or topic.endswith("Depth_Units/value")):
                    continue
                message = self._message(reader, *next(reader.messages([connection]))[::2])
                if connection.msgtype in _IMAGES:
                    kind = _encoding(message)
                    # Color before gray, then the most images, then the first name: of a pair the left eye.
                    rank = not kind.startswith("mono"), connection.msgcount
                    images.setdefault(kind in _DEPTH, {})[topic] = rank
                elif connection.msgtype == _INFO:
                    infos[topic] = message
                elif "/tf/" in topic:
                    self._places[topic] = _place(message)
                else:
                    self.metres_per_unit = float(message.data)
        if False not in images:
            topics = ", ".join(images.get(True, ()))
            raise CaptureError(f"'{path}': no color images in it; topics of images: {topics}")
        found = {is_depth: max(sorted(of), key=of.__getitem__) for is_depth, of in images.items()}
        self.color, self.depth = found[False], found.get(True)
        self.infos = {topic: _of_nearest_topic(topic, infos) for topic in found.values()}

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        try:
            with self._open() as reader:
                yield reader
        except CaptureError:
            raise
        except (self._broken, OSError, ValueError) as error:
            raise CaptureError(
                f"'{self._path}': {error}; expected a .bag, .mcap, .db3 or the folder of a ROS 2 bag"
            ) from error

    def _message(self, reader: Any, connection: Any, data: Any) -> Any:
        try:
            return reader.deserialize(data, connection.msgtype)
        except self._broken:
            return reader.deserialize(data[:-_TAIL], connection.msgtype)

    def messages(self, topic: str) -> Iterator[tuple[float, Any]]:
        """Yield time [s] and message."""
        with self._opened() as reader:
            wanted = [each for each in reader.connections if each.topic == topic]
            for connection, _, data in reader.messages(wanted):
                message = self._message(reader, connection, data)
                yield message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec, message

    def camera(self, topic: str) -> tuple[Intrinsics, Lens | None]:
        """Return the camera of a topic, and what bends its light."""
        info = self.infos[topic]
        if info is None:
            raise CaptureError(f"'{self._path}': no camera_info for {topic}; record it, too")
        matrix = np.array(getattr(info, "k", getattr(info, "K", None)), np.float64).reshape(3, 3)
        bends = [float(each) for each in getattr(info, "d", getattr(info, "D", ()))]
        k = Intrinsics.from_matrix(matrix, info.width, info.height, first_center=0)
        if "rect" in topic or not any(bends):  # rectified images have none any more
            return k, None
        model = info.distortion_model.lower().replace("_", " ")
        if model in _FISHEYE:
            return k, Lens(tuple(bends[:4]), is_fisheye=True)
        if model not in _BROWN or len(bends) > 8:
            raise CaptureError(
                f"'{self._path}': lens model {info.distortion_model} of {topic}, expected plumb_bob or "
                "equidistant; record the rectified images"
            )
        return k, Lens.brown(*bends)

    def color_from_depth(self) -> np.ndarray | None:
        """Return the rigid motion between the two cameras; None where the bag has no places."""
        color, depth = (
            _of_nearest_topic(topic or "/", self._places) for topic in (self.color, self.depth)
        )
        if color is None or depth is None:
            return None
        found = color @ invert_rigid(depth)
        return None if np.allclose(found, np.eye(4), atol=1e-9) else found


def _place(message: Any) -> np.ndarray:
    """Return where a stream of librealsense is: camera from the place that all of them refer to, (4, 4)."""
    if hasattr(message, "data"):  # since 2.56: "rotation=" by columns, ";translation="
        numbers = [
            np.array(part.partition("=")[2].split(","), np.float64)
            for part in message.data.split(";")[:2]
        ]
        return rigid(numbers[0].reshape(3, 3).T, numbers[1])
    turn, shift = message.rotation, message.translation
    return rigid(
        matrix_from_quat_xyzw(np.array([turn.x, turn.y, turn.z, turn.w])),
        np.array([shift.x, shift.y, shift.z]),
    )


def _of_nearest_topic(topic: str, others: dict[str, Any]) -> Any:
    """Return what is known by a topic that begins like ``topic``; None: none, or several, do."""
    shared = {name: len(commonpath([topic, name])) for name in others}
    best = [name for name, length in shared.items() if length == max(shared.values())]
    return others[best[0]] if len(best) == 1 else None


def _encoding(message: Any) -> str:
    return (
        message.encoding if hasattr(message, "encoding") else message.format.split(";")[0].strip()
    )


def _pixels(message: Any, path: Path) -> np.ndarray:
    """Return the pixels of a message, (height, width, channels); red first."""
    import cv2

    encoding = _encoding(message)
    if hasattr(message, "format"):
        skipped = _DEPTH_HEADER if "compressedDepth" in message.format else 0
        found = cv2.imdecode(np.frombuffer(message.data, np.uint8)[skipped:], cv2.IMREAD_UNCHANGED)
        if found is None:
            raise CaptureError(f"'{path}': an image of the form {message.format} cannot be decoded")
        return np.atleast_3d(found)[..., ::-1] if found.ndim == 3 else found[..., None]
    if encoding not in _ENCODINGS:
        raise CaptureError(
            f"'{path}': images of the encoding {encoding}, expected one of {', '.join(_ENCODINGS)}"
        )
    kind, channels = _ENCODINGS[encoding]
    order = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
    pixels = np.ascontiguousarray(rows[:, : message.width * channels * order.itemsize]).view(order)
    pixels = pixels.reshape(message.height, message.width, channels)
    return pixels[..., 2::-1] if encoding.startswith("bgr") else pixels


def _rgb(pixels: np.ndarray) -> np.ndarray:
    """Return an image, (height, width, 3), uint8."""
    return np.ascontiguousarray(
        np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3]
    )
