"""Sets that training programs load frame by frame: HDF5 with BlenderProc's keys, and WebDataset.

docs/formats.md has what they hold. campose of HDF5 is JSON text with OpenGL axes, as BlenderProc writes its
cameras; WebDataset has OpenCV axes, and `FRAMES_PER_SHARD` frames in a file. Pixel centers are at +0.5, as
here. See https://dlr-rm.github.io/BlenderProc and https://github.com/webdataset/webdataset.
"""

import io
import json
import tarfile
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import encode_image
from digs_warp.data.layers import Layer
from digs_warp.device.libraries import MissingLibraryError
from digs_warp.formats.captures.frames import for_each_frame
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.files import new_file, to_json

FRAMES_PER_SHARD = 64


def write_hdf5(capture: Capture, folder: Path) -> None:
    """Write a file of HDF5 for each frame."""
    try:
        import h5py  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError as error:
        raise MissingLibraryError(
            "HDF5 needs the package 'h5py': pip install 'digs-warp[hdf5]'"
        ) from error

    def write_frame(number: int, frame: Frame) -> None:
        data = {"colors": frame.load_image()}
        if frame.has(Layer.RIGHT):
            data["colors"] = np.stack([data["colors"], frame.load_right_image()])
        if frame.has(Layer.DEPTH):
            data["depth"] = _known(frame)
        if frame.has(Layer.INSTANCES):
            data["instance_segmaps"] = frame.load_instances().astype(np.uint8)
        elif frame.has(Layer.MASK):
            data["instance_segmaps"] = (frame.load_mask() > 127).astype(np.uint8)
        with new_file(folder / f"{number}.hdf5") as path, h5py.File(path, "w") as file:
            for name, values in data.items():
                file.create_dataset(name, data=values, compression="gzip", compression_opts=1)
            camera = _camera(frame, frame.camera.world_from_cam @ OPENCV_FROM_OPENGL)
            file["campose"] = json.dumps([camera])

    for_each_frame(capture.frames, "Writing HDF5", write_frame)


def write_webdataset(capture: Capture, folder: Path) -> None:
    """Write shards of WebDataset."""

    def parts(number: int, frame: Frame) -> dict[str, bytes]:
        found = {"image.png": encode_image(frame.load_image(), ".png")}
        if frame.has(Layer.RIGHT):
            found["right.png"] = encode_image(frame.load_right_image(), ".png")
        if frame.has(Layer.DEPTH):
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, _known(frame))
            found["depth.npy"] = buffer.getvalue()
        if frame.has(Layer.MASK):
            found["mask.png"] = encode_image(frame.load_mask(), ".png")
        facts = _camera(frame, frame.camera.world_from_cam) | {"time": frame.time}
        return found | {"json": to_json(facts).encode()}

    for shard, first in enumerate(range(0, len(capture), FRAMES_PER_SHARD)):
        some = capture.frames[first : first + FRAMES_PER_SHARD]
        with new_file(folder / f"frames-{shard:06d}.tar") as path, tarfile.open(path, "w") as tar:
            for number, found in enumerate(for_each_frame(some, f"Shard {shard}", parts), first):
                for suffix, data in found.items():
                    entry = tarfile.TarInfo(f"{number:04d}.{suffix}")
                    entry.size = len(data)
                    tar.addfile(entry, io.BytesIO(data))


def _known(frame: Frame) -> np.ndarray:
    """Return the measured depth [m], 0 where it is unknown."""
    return np.nan_to_num(frame.load_depth(), nan=0.0)


def _camera(frame: Frame, cam2world: np.ndarray) -> dict[str, Any]:
    return {
        "cam_K": frame.camera.intrinsics.matrix.tolist(),
        "cam2world_matrix": cam2world.tolist(),
    }
