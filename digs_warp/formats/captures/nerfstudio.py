"""nerfstudio: reads transforms.json of other programs, and writes a data set that OpenSplat reads, too.

Others have JPEG images, lens distortion, and often no depth. Poses stay in nerfstudio's world, which
``applied_transform`` rotated to have z up; ``applied_scale`` is undone, because depth is in metres. See
https://docs.nerf.studio/quickstart/data_conventions.html. A capture folder has nerfstudio's index already; in
what we write, splatfacto and OpenSplat also find points to start from (``ply_file_path``, in the order that
OpenSplat insists on), depth in millimetres, and the names of the held-out frames.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import POINTS, camera_keys, size_keys
from digs_warp.data.file_names import FileNames
from digs_warp.data.frame import Frame
from digs_warp.data.images import MM_PER_METRE, image_size, write_image
from digs_warp.data.index_rules import (
    INDEX_NAME,
    PINHOLES,
    POINTS_KEY,
    check_depth_unit,
    check_section,
    read_lens,
    unread_files,
)
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud, read_points, write_points
from digs_warp.formats.captures.frames import (
    copy_image,
    encode_depth,
    for_each_frame,
    start_points,
    warn_of_lost_depth,
    write_mask,
)
from digs_warp.formats.captures.lens import Lens, undistorted
from digs_warp.formats.captures.recording import (
    IMAGE_SUFFIXES,
    RecordedFrame,
    Recording,
    in_seconds,
    known_pose,
)
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.fields import ABOVE_ZERO, Fields
from digs_warp.record.files import read_json, to_json, write_atomically

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
        write_points(folder / POINTS, start)
    index = _index(capture, layers, has_points=len(start) > 0)
    write_atomically(folder / INDEX_NAME, to_json(index).encode())


def _index(capture: Capture, layers: set[Layer], has_points: bool) -> dict[str, Any]:
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
    if has_points:
        index[POINTS_KEY] = POINTS
    return index | _split(capture, names) | {"frames": frames}


def _all_camera_keys(k: Intrinsics) -> dict[str, float]:
    return {**size_keys(k), **camera_keys(k)}


def _split(capture: Capture, names: list[str]) -> dict[str, list[str]]:
    """Return the names of the training and the held-out frames, as `digs-warp reconstruct` splits them."""
    numbers = {frame: number for number, frame in enumerate(capture.frames)}
    seen, held_out = ([names[numbers[frame]] for frame in part] for part in capture.split())
    if not seen or not held_out:
        return {}
    return {"train_filenames": seen, "val_filenames": held_out, "test_filenames": held_out}


DISTORTION_KEYS = ("k1", "k2", "p1", "p2", "k3", "k4")
FULL_KEYS = (*DISTORTION_KEYS, "k5", "k6")
FISHEYE_KEYS = ("k1", "k2", "k3", "k4")


# What else the index of a synthetic scene is called: the frames for training count.
OTHER_INDICES = ("transforms_train.json", "transforms_test.json", "transforms_val.json")


def read_nerfstudio(folder: Path) -> Recording:
    """Read a folder with transforms.json, or with transforms_train.json."""
    names = [name for name in (INDEX_NAME, *OTHER_INDICES) if (folder / name).is_file()]
    name = (names or [INDEX_NAME])[0]
    index = read_json(folder / name, "nerfstudio index")
    entries = index.get("frames")
    if not isinstance(entries, list) or not entries:
        raise CaptureError(f"recording '{folder}': {name} lists no frames")
    ours = index.get("digs_warp")
    if isinstance(ours, dict):
        check_section(ours, f"recording '{folder}', digs_warp in {name}")
    shared = Fields(index, f"recording '{folder}', {name}", CaptureError)
    scale = shared.number("applied_scale", ABOVE_ZERO, default=1.0, what="a number above 0")
    files = FileNames(folder)
    if name in OTHER_INDICES and names[1:]:
        files.notes[f"only the frames of {name} are read, not those of {', '.join(names[1:])}"] = 1
    files.notes += unread_files([index, *entries], [*(layer.value for layer in Layer), *ALIASES])
    rows = [
        replace(
            Fields.of(entry, f"recording '{folder}', frame {i} of {name}", CaptureError),
            shared=index,
        )
        for i, entry in enumerate(entries)
    ]
    times = in_seconds([_time(row, i) for i, row in enumerate(rows)], files.notes)
    frames = tuple(_frame(files, *each, scale) for each in zip(rows, times, strict=True))
    rig = shared.section("digs_warp", optional=True).section("rig", optional=True)
    baseline = rig.number("baseline", ABOVE_ZERO, default=None, what="metres above 0")
    return Recording(
        folder,
        frames,
        baseline=baseline,
        points=_points(files, shared, scale),
        poses_in_metres=any(frame.depth is not None for frame in frames),
        notes=files.notes,
    )


def _points(
    files: FileNames, shared: Fields, scale: float
) -> Callable[[np.ndarray], PointCloud] | None:
    """Return what reads the sparse points; an index may name a file that was not copied."""
    name = shared.text(POINTS_KEY, "")
    path = files.find(name) if name else None
    if name and path is None:
        files.notes[f"the points '{name}' are not there"] = 1
    return None if path is None else lambda offset: read_points(path, offset, scale)


def _time(row: Fields, number: int) -> float:
    return row.number("time", default=row.number("timestamp", default=float(number)))


# What other programs call our keys: NeRFCapture and instant-ngp have depth_path.
ALIASES = {"depth_path": Layer.DEPTH, "mask_file_path": Layer.MASK}


def _frame(files: FileNames, row: Fields, time: float, scale: float) -> RecordedFrame:
    image = files.require(row.text("file_path"), row.where, ("", *IMAGE_SUFFIXES))
    pose = _pose(row, scale)
    k = _intrinsics(row, image)
    known = {layer: row.text(layer.value, "") for layer in (Layer.DEPTH, Layer.MASK, Layer.RIGHT)}
    for key, layer in ALIASES.items():
        known[layer] = known[layer] or row.text(key, "")
    depth, mask, right = (
        files.require(name, f"{row.where}, {layer.value}") if name else None
        for layer, name in known.items()
    )
    return RecordedFrame(
        image=image,
        intrinsics=k,
        time=time,
        world_from_cam=pose,
        depth=depth,
        mask=mask,
        right=right,
        view=undistorted(k, _lens(row)),
        **_depth_units(row),
    )


def _pose(row: Fields, scale: float) -> np.ndarray | None:
    """Return world from camera; None where the program that wrote it was lost."""
    matrix = row.array("transform_matrix", (4, 4), finite=False)
    matrix[:3, 3] /= scale
    pose = known_pose(matrix)
    return None if pose is None else pose @ OPENCV_FROM_OPENGL


def _lens(row: Fields) -> Lens | None:
    """Return what bends the light; refuse lenses with more coefficients than we know."""
    lens = read_lens(dict(row.shared or {}), dict(row.values), row.where)
    is_full = lens.model == "FULL_OPENCV"
    keys = FISHEYE_KEYS if lens.is_fisheye else FULL_KEYS if is_full else DISTORTION_KEYS
    if more := sorted(lens.coefficients.keys() - set(keys)):
        raise CaptureError(
            f"{row.where}: {lens.model} with {', '.join(more)}, expected only {', '.join(keys)}; "
            f"{PINHOLES}"
        )
    found = tuple(lens.coefficients.get(key, 0.0) for key in keys)
    if lens.is_fisheye:
        return Lens(found, is_fisheye=True)
    if is_full:
        return Lens.brown(*found)
    # nerfstudio's k4 goes with the eighth power of the radius; OpenCV's is another.
    return Lens(found[:5], eighth=found[5]) if any(found) else None


def _depth_units(row: Fields) -> dict[str, Any]:
    """Return the units of depth images as `RecordedFrame` has them; the index may give metres per unit."""
    check_depth_unit({**(row.shared or {}), **row.values}, row.where)
    what = "metres per unit, above 0"
    for key in ("depth_unit_scale_factor", "integer_depth_scale"):
        given = row.number(key, ABOVE_ZERO, default=None, what=what)
        if given is not None:
            kinds = ("depth", "float") if key == "depth_unit_scale_factor" else ("depth",)
            return {f"{kind}_units_per_metre": 1 / given for kind in kinds}
    return {}


def _intrinsics(row: Fields, image: Path) -> Intrinsics:
    """Return the camera: from the frame's keys, the shared ones, or the field of view of synthetic scenes."""
    size = (row.whole("w", 1), row.whole("h", 1)) if "w" in row else image_size(image)
    if "fl_x" not in row and "camera_angle_x" in row:
        angle = row.number("camera_angle_x", ABOVE_ZERO, math.pi, what="an angle below pi")
        return Intrinsics.from_fov(*size, math.degrees(angle))
    fx = row.number("fl_x", ABOVE_ZERO, what="pixels above 0")
    return Intrinsics(
        *size,
        fx,
        row.number("fl_y", ABOVE_ZERO, default=fx, what="pixels above 0"),
        row.number("cx", default=size[0] / 2),
        row.number("cy", default=size[1] / 2),
    )
