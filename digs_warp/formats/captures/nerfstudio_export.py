"""A capture as a data set for nerfstudio, which OpenSplat reads, too.

A capture folder has nerfstudio's index already. Here, splatfacto and OpenSplat also find points to start
from (``ply_file_path``), depth in millimetres, and the names of the held-out frames. The world stays as it
is: there is no ``applied_transform``. See https://docs.nerf.studio/quickstart/data_conventions.html.

    images/0000.png  masks/0000.png  depth/0000.png
    sparse_pc.ply    the points: x y z red green blue, the order that OpenSplat insists on
    transforms.json
"""

from pathlib import Path
from typing import Any

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import POINTS, camera_keys, size_keys
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.index_rules import INDEX_NAME, POINTS_KEY
from digs_warp.data.layers import Layer
from digs_warp.data.sparse_points import write_points
from digs_warp.formats.captures.frames import (
    copy_image,
    encode_depth,
    for_each_frame,
    warn_of_lost_depth,
    write_mask,
)
from digs_warp.formats.captures.recording import MM_PER_METRE
from digs_warp.formats.captures.start_points import StartPoints, start_points
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.files import to_json, write_atomically

DEPTH_PATTERN = "depth/{:04d}.png"


def write_nerfstudio(capture: Capture, folder: Path) -> None:
    """Write the capture as a data set for nerfstudio."""
    # nerfstudio wants a layer in all frames or in none.
    layers = {
        layer
        for layer in (Layer.MASK, Layer.DEPTH)
        if all(frame.has(layer) for frame in capture.frames)
    }

    def write_frame(number: int, frame: Frame) -> int:
        copy_image(frame, folder / Layer.IMAGE.pattern.format(number))
        if Layer.MASK in layers:
            write_mask(frame, folder / Layer.MASK.pattern.format(number))
        if Layer.DEPTH not in layers:
            return 0
        depth, lost = encode_depth(frame.load_depth(), MM_PER_METRE)
        write_image(folder / DEPTH_PATTERN.format(number), depth)
        return lost

    lost = sum(for_each_frame(capture.frames, "Writing nerfstudio", write_frame))
    warn_of_lost_depth(lost, MM_PER_METRE, "nerfstudio")
    start = start_points(capture)
    if len(start):
        write_points(folder / POINTS, start.cloud)
    index = _index(capture, layers, start)
    write_atomically(folder / INDEX_NAME, to_json(index).encode())


def _index(capture: Capture, layers: set[Layer], start: StartPoints) -> dict[str, Any]:
    cameras = {frame.camera.intrinsics for frame in capture.frames}
    names = [Layer.IMAGE.pattern.format(number) for number in range(len(capture))]
    frames = []
    for number, frame in enumerate(capture.frames):
        entry: dict[str, Any] = {
            "file_path": names[number],
            "transform_matrix": frame.camera.world_from_cam @ OPENCV_FROM_OPENGL,
            "time": frame.time,
        }
        if Layer.MASK in layers:
            entry[Layer.MASK.value] = Layer.MASK.pattern.format(number)
        if Layer.DEPTH in layers:
            entry[Layer.DEPTH.value] = DEPTH_PATTERN.format(number)
        if len(cameras) > 1:  # shared keys would win over those of a frame
            entry |= _all_camera_keys(frame.camera.intrinsics)
        frames.append(entry)
    index: dict[str, Any] = {"camera_model": "PINHOLE"}
    if len(cameras) == 1:
        index |= _all_camera_keys(cameras.pop())
    if len(start):
        index[POINTS_KEY] = POINTS
    return index | _split(capture, names, start) | {"frames": frames}


def _all_camera_keys(k: Intrinsics) -> dict[str, float]:
    return {**size_keys(k), **camera_keys(k)}


def _split(capture: Capture, names: list[str], start: StartPoints) -> dict[str, list[str]]:
    """Return the names of the training and the held-out frames, as `digs-warp reconstruct` splits them."""
    training = set(start.training)
    named = list(zip(capture.frames, names, strict=True))
    seen = [name for frame, name in named if frame in training]
    held_out = [name for frame, name in named if frame not in training]
    if not held_out:
        return {}
    return {"train_filenames": seen, "val_filenames": held_out, "test_filenames": held_out}
