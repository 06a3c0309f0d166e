"""What becomes of what each format holds: read, left out with a word, or refused with a cure.

Readers of recordings say by it what they leave out, and ``python -m studies page what-is-read`` makes
docs/what-is-read.md of it.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

from digs_warp.data.images import PICTURE_CURE
from digs_warp.data.index_rules import PINHOLES, UNDISTORT
from digs_warp.words import counted


@dataclass(frozen=True)
class Form:
    """A format.

    Attributes:
        name: of a recording what follows ``--from``.
        reads: what is read, and as what: of a folder its small files, paths with * below it.
        leaves: the same of what is left out, which is said.
        refuses: what is refused, and the cure that the message names.
    """

    name: str
    reads: Mapping[str, str]
    leaves: Mapping[str, str] = field(default_factory=dict)
    refuses: Mapping[str, str] = field(default_factory=dict)

    def unread(self, folder: Path, used: set[Path]) -> Iterator[str]:
        """Yield what is not read of a folder, apart from the ``used`` files, in words."""
        found: dict[str, int] = {}
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder).as_posix()
            if path in used or not path.is_file() or _matching(name, (*self.reads, *BESIDE)):
                continue
            pattern = _matching(name, self.leaves)
            place = f"{name.rpartition('/')[0]}/*{path.suffix}" if "/" in name else name
            words = f"{self.leaves[pattern]} ('{pattern}')" if pattern else f"'{place}'"
            found[words] = found.get(words, 0) + 1
        for words, count in found.items():
            yield words if count == 1 else f"{words}, {counted(count, 'file')}"


def _matching(name: str, patterns: Iterable[str]) -> str:
    return next((each for each in patterns if fnmatch(name, each)), "")


# Files that may lie anywhere and say nothing to a reader.
BESIDE = (".*", "*/.*", "*README*", "*LICENSE*", "*.md", "run.json", "files.jsonl", "Thumbs.db")

DEPTH_IMAGES = {
    "depth of integers": "millimetres, or the unit of the format; 0, negative and the largest number, "
    "65535, are unknown",
    "depth of floats": "metres; 0, negative, not finite, 65.535 and from 65504 on are unknown",
    "masks": "0 to 255; the alpha channel of a cut-out; or numbers of objects, all but 0 marked. Where the "
    "format has none: masks/ or mask/ beside the images, named like them",
}
REFUSED_IMAGES = {
    "depth in colors or of 8 bits": PICTURE_CURE,
    "images of another shape than the camera's": "give the camera of these images, or turn their pixels "
    "('mogrify -auto-orient'). Smaller or larger ones of the same shape get their camera scaled",
    "images with more than 8 bits": "convert them to 8 bits per channel",
}
LOST = "4 x 4, world from camera; zeros or not finite: unknown, and the frame is left out"

RECORDINGS = {
    form.name: form
    for form in (
        Form(
            "nerfstudio",
            {
                "transforms*.json": "cameras, poses, lens distortion, names of images, depth (depth_path of "
                "NeRFCapture, too) and masks, applied_scale, times; transforms_train.json if it is alone",
                "*.ply": "points to start from, where ply_file_path names them",
            },
            {
                "images_*/*": "smaller copies of the images",
                "depths_*/*": "smaller copies of the depth",
                "colmap/*": "the model of COLMAP behind the index",
            },
            {
                "camera models other than pinhole, OPENCV and OPENCV_FISHEYE": PINHOLES,
                "as a capture, without --from: distortion, other units, links to another disk": UNDISTORT,
            },
        ),
        Form(
            "tum",
            {
                "rgb.txt": "times and names of the images; nanoseconds and microseconds, too",
                "depth.txt": "the same of the depth, 5000 per metre",
                "groundtruth.txt": "poses, each the nearest in time within 20 ms; a quaternion of zeros is "
                "unknown",
                "calibration.txt": "fx fy cx cy, first pixel center at (0, 0)",
            },
            {"accelerometer.txt": "accelerations", "*.bag": "the recording as messages of ROS"},
            {
                "a camera that nobody names": "write calibration.txt",
                "times that match nothing": "correct the times in the file",
            },
        ),
        Form(
            "scannet",
            {"pose/*.txt": LOST, "intrinsic/intrinsic_*.txt": "cameras of color and depth"},
            {
                "intrinsic/extrinsic_*.txt": "places of the two cameras, which are taken for the same",
                "*label*": "labels of things",
                "*instance*": "numbers of things",
            },
        ),
        Form(
            "record3d",
            {
                "*metadata.json": "cameras, poses and rate; w and h may be exchanged, and K be that of the "
                "image before the phone turned it"
            },
            {"*conf*": "confidence in the depth", "*.m4a": "sound"},
        ),
        Form(
            "polycam",
            {
                "*cameras/*.json": "cameras and poses; those of Polycam's own adjustment where they are there"
            },
            {
                "*confidence/*": "confidence in the depth",
                "keyframes/images/*": "images before Polycam's adjustment",
                "keyframes/corrected_images/*": "images after it",
                "*mesh_info.json": "the mesh of Polycam",
                "*.glb": "the mesh of Polycam",
                "*.mp4": "a film of the scan",
                "*thumbnail*": "a small picture",
            },
        ),
        Form(
            "zed",
            {"calibration.json": "fx, fy, cx, cy, baseline [m]"},
            {"*conf*": "confidence in the depth", "*disparity*": "disparity"},
            {"a baseline above 2": "write it in metres"},
        ),
        Form(
            "redwood",
            {"camera_intrinsic.json": "the camera", "trajectory.log": LOST},
            {
                "fragments/*": "pieces of Open3D's reconstruction",
                "scene/*": "Open3D's reconstruction",
            },
        ),
        Form(
            "bop",
            {
                "*scene_camera.json": "cameras, unit of the depth, poses of the camera",
                "*scene_gt.json": "poses of the first object, where the camera has none",
            },
            {
                "*models*": "meshes of the objects",
                "*mask*": "masks of other objects than the first, or with what hides it",
                "*scene_gt_info.json": "boxes and counts",
                "*camera*.json": "the camera of the sensor, which each image has",
            },
            {"several scenes": "pass the folder of a scene"},
        ),
        Form(
            "colmap",
            {
                "*cameras.???": "cameras of all models but those refused, binary or text",
                "*images.???": "poses; in text with or without lines of points",
                "*points3D.???": "points to start from",
            },
            {
                "*rigs.???": "rigs: the poses of the images hold them",
                "*frames.???": "frames of rigs, the same",
                "*database.db*": "features and matches",
                "*stereo/*": "depth of COLMAP's dense matching",
                "images_*/*": "smaller copies of the images",
                "*.ply": "points in the format of other programs",
                "*.ini": "settings of COLMAP",
            },
            {
                "THIN_PRISM_FISHEYE, RAD_TAN_THIN_PRISM_FISHEYE and EQUIRECTANGULAR": PINHOLES,
                "names that leave the folder of images": "paths must stay inside",
            },
        ),
        Form(
            "7scenes",
            {
                "frame-*.pose.txt": LOST,
                "camera-intrinsics.txt": "the camera, here or one folder above",
                "*info.txt": "cameras and unit of depth",
            },
            {"*.ply": "a model of the scene"},
            {"a scene of several sequences": "name one of its sequences"},
        ),
        Form(
            "euroc",
            {
                "*cam?*sensor.yaml": "cameras and lenses",
                "*cam?/data.csv": "not needed: the names of the images are their times",
                "*state_groundtruth_estimate0/*": "poses; zeros are unknown, others are interpolated over "
                "up to 0.1 s; else",
                "*vicon0/*": "those of a marker, and where it is on the body; else",
                "*mocap0/*": "the same",
            },
            {
                "*imu0/*": "accelerometer and gyroscope",
                "*leica0/*": "places that a laser tracker measured",
                "*body.yaml": "the name of the body",
                "*pointcloud*": "a scan of the room",
                "*.bag": "the recording as messages of ROS",
            },
            {"eyes that are no stereo pair": "check T_BS, or swap the folders"},
        ),
    )
}

FILMS = (
    Form("video", {"any film that FFmpeg reads": "the sharpest frames"}, {"sound": "sound"}),
    Form(
        "realsense",
        {"*.bag": "color, or left infrared; depth registered to it"},
        {"accelerometer and gyroscope": "motion", "the right infrared image": "its pair"},
        {"lens models but Brown-Conrady and Kannala-Brandt": "record with another profile"},
    ),
    Form(
        "stray",
        {
            "rgb.mp4": "the sharpest frames",
            "depth/*.png": "millimetres",
            "odometry.csv": "poses",
            "camera_matrix.csv": "the camera",
        },
        {"confidence/*": "confidence in the depth", "imu.csv": "motion"},
    ),
    Form(
        "ros",
        {
            "*.bag, *.mcap, folders of ROS 2": "Image and CompressedImage: color, and depth from the same "
            "place; CameraInfo beside them"
        },
        {"all other topics": "poses, points, motion"},
        {
            "images without a camera_info": "record it, too",
            "encodings of Bayer and YUV": "record rgb8, bgr8, mono8 or compressed images",
        },
    ),
)
