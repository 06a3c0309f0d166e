"""BOP, the benchmark of object poses: one scene of one or several objects, in millimetres.

docs/formats.md has what we write. The model's frame is that of the mesh file that was recorded, in
millimetres, else the world's. Nothing hides a single object, so its silhouette is the mask; cut by the image
border, it counts as complete. Of several objects, the capture's object numbers give mask_visib, and its
`Frame.objects` boxes, counts and mask: the whole silhouette, as if nothing hid it. A mesh that is there twice
is two instances of one model. What we read may hold several objects; where an image has no pose of the camera
in the world, the frame of the first object is the world. See
https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import MM_PER_METRE, to_uint8, write_image
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.formats.captures.frames import (
    LARGEST_DEPTH,
    copy_image,
    encode_depth,
    for_each_frame,
    integer_centered,
    object_mask,
    warn_of_lost_depth,
)
from digs_warp.formats.captures.recording import NumberedFiles, Recording
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid, rigid
from digs_warp.record.fields import ABOVE_ZERO, Fields
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.words import counted

SCENE = "train/000000"
OBJECT_ID = 1
CAMERAS, POSES = "scene_camera.json", "scene_gt.json"

# [mm] per unit of a depth image; each image takes the finest one that holds its farthest depth. A tenth
# of a millimetre is below the noise of any stereo camera and reaches 6.5 m.
DEPTH_SCALES = (0.1, 0.2, 0.5, 1.0)

SMALLEST_VOLUME = 0.1  # of a rotation: 1, up to rounding

NO_BOX = [-1, -1, -1, -1]  # BOP's own sign for an object out of view


def read_bop(folder: Path) -> Recording:
    """Read one scene, the folder with scene_camera.json, or a data set of one; images list what they show."""
    scene = _the_scene(folder)
    files = NumberedFiles.find(scene, "rgb/" if (scene / "rgb").is_dir() else "gray/", "depth/")
    all_cameras = _fields(scene / CAMERAS, "cameras")
    objects = _fields(scene / POSES, "poses") if (scene / POSES).is_file() else None
    cameras, poses, units, masks, first = {}, {}, {}, {}, None
    for number in files.images:
        camera = all_cameras.section(str(number))
        matrix = camera.array("cam_K", (3, 3))
        seen = objects.sections(str(number), []) if objects else []
        ids = [each.whole("obj_id") for each in seen]
        first = ids[0] if ids and first is None else first
        place = ids.index(first) if first in ids else None
        poses[number] = _world_from_cam(camera, None if place is None else seen[place])
        units[number] = MM_PER_METRE / camera.number("depth_scale", ABOVE_ZERO, default=1.0)
        cameras[number] = Intrinsics.from_matrix(matrix, *files.image_size, first_center=0)
        for kind in ("mask", "mask_visib"):  # the second is preferred
            mask = scene / kind / f"{number:06d}_{place or 0:06d}.png"
            if mask.is_file() and not (ids and place is None):
                masks[number] = mask
    return files.recording(cameras, poses, depth_units_per_metre=units, mask=masks)


def _the_scene(folder: Path) -> Path:
    if (folder / CAMERAS).is_file():
        return folder
    scenes = sorted(path.parent for path in folder.glob(f"*/*/{CAMERAS}"))
    if len(scenes) != 1:
        raise CaptureError(
            f"recording '{folder}': {counted(len(scenes), 'BOP scene')} ({CAMERAS} marks one), expected one; "
            "pass the folder of a scene"
        )
    return scenes[0]


def _fields(path: Path, what: str) -> Fields:
    return Fields(read_json(path, what), f"'{path}'", CaptureError)


def _world_from_cam(camera: Fields, first: Fields | None) -> np.ndarray | None:
    """Return the pose of the camera in the world, else in the frame of the first object [m]."""
    if "cam_R_w2c" in camera:
        return _inverse(camera, "cam_R_w2c", "cam_t_w2c")
    return None if first is None else _inverse(first, "cam_R_m2c", "cam_t_m2c")


def _inverse(pose: Fields, rotation: str, translation: str) -> np.ndarray | None:
    """Return the inverse of a pose whose translation is in millimetres [m]."""
    turn = pose.array(rotation, (3, 3))
    if not turn.any():  # lost
        return None
    if abs(np.linalg.det(turn)) < SMALLEST_VOLUME:
        raise CaptureError(f"{pose.where}: {rotation} is no rotation")
    return np.linalg.inv(rigid(turn, pose.array(translation, (3,)) / MM_PER_METRE))


def write_bop(capture: Capture, folder: Path) -> None:
    """Write the capture as a BOP data set of one scene."""
    ids = model_ids(capture)

    def write_frame(number: int, frame: Frame) -> tuple[dict[str, Any], list[Any], int]:
        depth, masks = frame.load_depth(), visible_masks(frame, len(ids))
        scale = depth_scale(depth)
        encoded, lost = encode_depth(depth, MM_PER_METRE / scale)
        copy_image(frame, folder / SCENE / f"rgb/{number:06d}.png")
        write_image(folder / SCENE / f"depth/{number:06d}.png", encoded)
        for kind, silhouettes in (("mask", whole_masks(frame, masks)), ("mask_visib", masks)):
            for i, mask in enumerate(silhouettes):
                path = folder / SCENE / kind / f"{number:06d}_{i:06d}.png"
                write_image(path, np.where(mask, 255, 0).astype(np.uint8))
        return _camera(frame, scale), _object_infos(frame, masks, encoded > 0), lost

    cameras, infos, lost = zip(
        *for_each_frame(capture.frames, "Writing BOP", write_frame), strict=True
    )
    warn_of_lost_depth(sum(lost), MM_PER_METRE / DEPTH_SCALES[-1], "BOP")
    placements = [model_placement(capture, i) for i in range(len(ids))]
    poses = [
        [_object_pose(frame, *each) for each in zip(ids, placements, strict=True)]
        for frame in capture.frames
    ]
    _write_json(folder / SCENE / CAMERAS, dict(enumerate(cameras)))
    _write_json(folder / SCENE / POSES, dict(enumerate(poses)))
    _write_json(folder / SCENE / "scene_gt_info.json", dict(enumerate(infos)))
    k = integer_centered(capture.frames[0].camera.intrinsics)
    sensor = {"width": k.width, "height": k.height, "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy}
    largest = max(camera["depth_scale"] for camera in cameras)
    _write_json(folder / "camera.json", sensor | {"depth_scale": largest})


def model_ids(capture: Capture) -> list[int]:
    """Return the model of each object of a capture; equal meshes have one model, named after the first."""
    meshes = [each.mesh for each in capture.about.objects or ()]
    if len(meshes) < 2:
        return [OBJECT_ID]
    return [OBJECT_ID + meshes.index(mesh) for mesh in meshes]


def visible_masks(frame: Frame, count: int) -> list[np.ndarray]:
    """Return where an image shows each of its objects, (height, width), bool."""
    if count == 1:
        return [object_mask(frame)]
    numbers = frame.load_instances()
    return [numbers == i + 1 for i in range(count)]


def whole_masks(frame: Frame, visible: list[np.ndarray]) -> list[np.ndarray]:
    """Return the silhouettes that the objects would have if nothing hid them, each (height, width), bool."""
    if len(visible) == 1:
        return visible
    if len(frame.objects) != len(visible):
        raise CaptureError(
            f"frame '{frame.name}': views of {len(frame.objects)} objects, expected {len(visible)}; record "
            "it again with digs-warp simulate --scene"
        )
    return [frame.load_silhouette(view) for view in frame.objects]


def model_placement(capture: Capture, index: int = 0) -> np.ndarray:
    """Return rotation and translation [mm] from a model to the world [mm], shape (4, 4).

    The model is the mesh file of an object in millimetres; without one, its frame is the world's.
    """
    objects = capture.about.objects or ()
    rows = objects[index].world_from_mesh if len(objects) > 1 else capture.about.world_from_mesh
    if rows is None:
        return np.eye(4)
    world_from_mesh = np.array(rows)
    rotation = world_from_mesh[:3, :3] / np.cbrt(np.linalg.det(world_from_mesh[:3, :3]))
    return rigid(rotation, world_from_mesh[:3, 3] * MM_PER_METRE)


def depth_scale(depth: np.ndarray) -> float:
    """Return the finest scale [mm] in which 16 bits reach the farthest known depth [m]."""
    farthest_mm = np.nan_to_num(depth, nan=0.0).max() * MM_PER_METRE
    fitting = (scale for scale in DEPTH_SCALES if farthest_mm / scale <= LARGEST_DEPTH)
    return next(fitting, DEPTH_SCALES[-1])


def _camera(frame: Frame, scale: float) -> dict[str, Any]:
    cam_from_world = frame.camera.cam_from_world
    return {
        "cam_K": integer_centered(frame.camera.intrinsics).matrix.ravel().tolist(),
        "depth_scale": scale,
        "cam_R_w2c": cam_from_world[:3, :3].ravel().tolist(),
        "cam_t_w2c": (cam_from_world[:3, 3] * MM_PER_METRE).tolist(),
    }


def _object_pose(frame: Frame, number: int, world_from_model: np.ndarray) -> dict[str, Any]:
    cam_from_world = frame.camera.cam_from_world
    in_mm = rigid(cam_from_world[:3, :3], cam_from_world[:3, 3] * MM_PER_METRE)
    cam_from_model = in_mm @ world_from_model
    return {
        "obj_id": number,
        "cam_R_m2c": cam_from_model[:3, :3].ravel().tolist(),
        "cam_t_m2c": cam_from_model[:3, 3].tolist(),
    }


def _object_infos(frame: Frame, masks: list[np.ndarray], known: np.ndarray) -> list[dict[str, Any]]:
    """Return boxes and counts of each object of a frame; BOP's widths are from center to center of pixels."""
    infos = []
    for number, mask in enumerate(masks):
        pixels, box = int(np.count_nonzero(mask)), NO_BOX
        if pixels:
            rows, columns = np.nonzero(mask)
            x, y = int(columns.min()), int(rows.min())
            box = [x, y, int(columns.max()) - x, int(rows.max()) - y]
        info = {
            "bbox_obj": box,
            "bbox_visib": box,
            "px_count_all": pixels,
            "px_count_valid": int(np.count_nonzero(mask & known)),
            "px_count_visib": pixels,
            "visib_fract": 1.0 if pixels else 0.0,
        }
        if len(masks) > 1:
            view = frame.objects[number]
            x, y, width, height = view.box or (-1, -1, 0, 0)
            info |= {
                "bbox_obj": [x, y, width - 1, height - 1],
                "px_count_all": view.pixels,
                "visib_fract": view.visible_share,
            }
        infos.append(info)
    return infos


def _write_json(path: Path, content: dict[Any, Any]) -> None:
    write_atomically(path, to_json(content).encode())


MODELS = "models"

# Rows of the matrix of distances at a time.
ROWS = 512


def write_bop_models(capture: Capture, surfaces: Sequence[TriangleMesh], folder: Path) -> None:
    """Write models/obj_000001.ply and so on, and models/models_info.json, of the data set in ``folder``.

    Args:
        capture: that `digs_warp.formats.captures.bop.write_bop` wrote to ``folder``.
        surfaces: its objects, in the world.
        folder: of the data set.
    """
    infos: dict[int, dict[str, float]] = {}
    for index, (number, surface) in enumerate(zip(model_ids(capture), surfaces, strict=True)):
        if number not in infos:
            model_from_world = invert_rigid(model_placement(capture, index))
            infos[number] = _write_model(surface, model_from_world, folder, number)
    write_atomically(folder / MODELS / "models_info.json", to_json(infos).encode())


def _write_model(
    surface: TriangleMesh, model_from_world: np.ndarray, folder: Path, number: int
) -> dict[str, float]:
    """Write one model; return its size."""
    import trimesh

    points = MM_PER_METRE * surface.points_world.astype(np.float64)
    points = points @ model_from_world[:3, :3].T + model_from_world[:3, 3]
    colored = trimesh.Trimesh(
        points, surface.triangles, vertex_colors=to_uint8(surface.colors), process=False
    )
    data = colored.export(file_type="ply", vertex_normal=True)
    assert isinstance(data, bytes)
    write_atomically(folder / MODELS / f"obj_{number:06d}.ply", data)
    low, high = points.min(axis=0), points.max(axis=0)
    info: dict[str, float] = {"diameter": diameter(points)}
    info |= {f"min_{axis}": float(value) for axis, value in zip("xyz", low, strict=True)}
    info |= {f"size_{axis}": float(value) for axis, value in zip("xyz", high - low, strict=True)}
    return info


def diameter(points: np.ndarray) -> float:
    """Return the largest distance between two of the points, shape (n, 3)."""
    from scipy.spatial import ConvexHull
    from scipy.spatial.distance import cdist

    # Only corners of the hull are that far apart. Joggled, because a flat mesh has no hull.
    corners = points[ConvexHull(points, qhull_options="QJ").vertices] if len(points) > 4 else points
    parts = (corners[i : i + ROWS] for i in range(0, len(corners), ROWS))
    return max(float(cdist(part, corners).max()) for part in parts)
