"""What becomes of what each format holds: read, left out with a word, or refused with a cure.

Readers of recordings say by it what they leave out, and ``python -m studies page what-is-read`` makes
docs/what-is-read.md of it.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

from digs_warp.words import counted


@dataclass(frozen=True)
class Form:
    """A format.

    Attributes:
        name: of a recording what follows ``--from``.
        reads: what is read, in words.
        leaves: what is left out, which is said: of a folder by pattern, paths with * below it.
        refuses: what is refused; the message names the cure.
        files: the small files that are read, patterns between blanks.
    """

    name: str
    reads: str
    leaves: Mapping[str, str] = field(default_factory=dict)
    refuses: str = ""
    files: str = ""

    def unread(self, folder: Path, used: set[Path]) -> Iterator[str]:
        """Yield what is not read of a folder, apart from the ``used`` files, in words."""
        found: dict[str, int] = {}
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder).as_posix()
            if (
                path in used
                or not path.is_file()
                or _matching(name, (*self.files.split(), *BESIDE))
            ):
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

CONFIDENCE = {"*conf*": "confidence in the depth"}
SMALLER = {"images_*/*": "smaller copies of the images"}

RECORDINGS = {
    form.name: form
    for form in (
        Form(
            "nerfstudio",
            "cameras, poses, lens distortion, depth (also depth_path), masks, applied_scale, times, points; "
            "transforms_train.json if it is alone",
            {
                **SMALLER,
                "depths_*/*": "smaller copies of the depth",
                "colmap/*": "the model behind the index",
            },
            "camera models other than pinhole, OPENCV and OPENCV_FISHEYE; without --from also distortion, "
            "other units and links to another disk",
            "transforms*.json *.ply",
        ),
        Form(
            "tum",
            "lists of images and depth (5000 per metre), poses (the nearest in time within 20 ms), "
            "calibration.txt (first pixel center at 0, 0)",
            {"accelerometer.txt": "accelerations", "*.bag": "the recording as messages of ROS"},
            "a camera that nobody names; times that match nothing",
            "rgb.txt depth.txt groundtruth.txt calibration.txt",
        ),
        Form(
            "scannet",
            "poses, cameras of color and depth",
            {
                "intrinsic/extrinsic_*.txt": "places of the two cameras, which are taken for the same",
                "*label*": "labels of things",
                "*instance*": "numbers of things",
            },
            files="pose/*.txt intrinsic/intrinsic_*.txt",
        ),
        Form(
            "record3d",
            "a folder EXR + RGB, or .r3d: cameras, poses, rate; sizes may be those before the phone turned",
            {**CONFIDENCE, "*.m4a": "sound"},
            files="*metadata.json",
        ),
        Form(
            "polycam",
            "cameras and poses, those of Polycam's own adjustment where they are there",
            {
                **CONFIDENCE,
                "keyframes/images/*": "images before Polycam's adjustment",
                "keyframes/corrected_images/*": "images after it",
                "*mesh_info.json": "the mesh of Polycam",
                "*.glb": "the mesh of Polycam",
                "*.mp4": "a film of the scan",
                "*thumbnail*": "a small picture",
            },
            files="*cameras/*.json",
        ),
        Form(
            "zed",
            "calibration.json: fx, fy, cx, cy, baseline [m]",
            {**CONFIDENCE, "*disparity*": "disparity"},
            "a baseline above 2",
            "calibration.json",
        ),
        Form(
            "redwood",
            "camera_intrinsic.json, trajectory.log",
            {
                "fragments/*": "pieces of Open3D's reconstruction",
                "scene/*": "Open3D's reconstruction",
            },
            files="camera_intrinsic.json trajectory.log",
        ),
        Form(
            "bop",
            "cameras, unit of the depth, poses of the camera, else of the first object",
            {
                "*models*": "meshes of the objects",
                "*mask*": "masks of other objects than the first, or with what hides it",
                "*scene_gt_info.json": "boxes and counts",
                "*camera*.json": "the camera of the sensor, which each image has",
            },
            "several scenes",
            "*scene_camera.json *scene_gt.json",
        ),
        Form(
            "colmap",
            "cameras, poses and points of the largest model, binary or text",
            {
                **SMALLER,
                "*rigs.???": "rigs: the poses of the images hold them",
                "*frames.???": "frames of rigs, the same",
                "*database.db*": "features and matches",
                "*stereo/*": "depth of COLMAP's dense matching",
                "*.ply": "points in the format of other programs",
                "*.ini": "settings of COLMAP",
            },
            "THIN_PRISM_FISHEYE, RAD_TAN_THIN_PRISM_FISHEYE, EQUIRECTANGULAR",
            "*cameras.[bt]?? *images.[bt]?? *points3D.[bt]??",
        ),
        Form(
            "euroc",
            "cameras, lenses and places of both eyes; poses of the body or a marker on it, interpolated at "
            "most 0.05 s from a measurement",
            {
                "*imu0/*": "accelerometer and gyroscope",
                "*leica0/*": "places that a laser tracker measured",
            },
            "eyes that are no stereo pair",
            "*cam?*sensor.yaml *cam?/data.csv *state_groundtruth_estimate0/* *vicon0/* *mocap0/*",
        ),
        Form(
            "7scenes",
            "poses; the camera in camera-intrinsics.txt or info.txt, here or one folder above",
            {"*.ply": "a model of the scene"},
            "a scene of several sequences",
            "frame-*.pose.txt camera-intrinsics.txt *info.txt",
        ),
    )
}

FILMS = (
    Form("video", "the sharpest frames of any film that FFmpeg reads", {"sound": "sound"}),
    Form(
        "stray",
        "the sharpest frames of rgb.mp4, depth, odometry.csv, camera_matrix.csv",
        {**CONFIDENCE, "imu.csv": "motion"},
        files="rgb.mp4 odometry.csv camera_matrix.csv depth/*",
    ),
    Form(
        "ros, realsense",
        "color and depth of a .bag, .mcap, .db3 or folder of ROS 2, with the cameras beside them",
        {"all other topics": "poses, points, motion, the right infrared image"},
        "images without a camera_info, of Bayer and YUV; other lenses than Brown's and Kannala's",
    ),
)
FORMS = {**RECORDINGS, **{form.name: form for form in FILMS}}
