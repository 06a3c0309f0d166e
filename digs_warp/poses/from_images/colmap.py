"""The calls into COLMAP: features, matches, mapping and triangulation, each with progress and Ctrl-C.

What COLMAP is told here decides the result, so every option that is not its default says why.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.libraries import import_pycolmap
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses import thresholds
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.disk import check_room
from digs_warp.record.files import remove, write_atomically
from digs_warp.record.progress import progress

Result = TypeVar("Result")

POLL_SECONDS = 0.2


def run_interruptible(
    call: Callable[..., Result], watch: Callable[[], Any] = lambda: None
) -> Result:
    """Run ``call(cancellation_token=...)`` on a separate thread and return its result.

    Python handles Ctrl-C on the main thread only when that one runs Python code, and a call into COLMAP
    takes minutes; so the main thread waits here. Ctrl-C is raised once the cancelled call has returned: what
    it writes is then whole.

    Args:
        call: of COLMAP; it releases the interpreter lock while it computes.
        watch: called several times a second meanwhile, and once at the end.
    """
    token = import_pycolmap().CancellationToken()
    with ThreadPoolExecutor(
        1, thread_name_prefix="colmap"
    ) as pool:  # waits for the call at its end
        running = pool.submit(call, cancellation_token=token)
        try:
            while not wait([running], POLL_SECONDS).done:
                watch()
        except BaseException:
            token.cancel()
            raise
    watch()
    return running.result()


# Most matches of neighboring photographs are right, and RANSAC's own confidence tells when it may stop.
# COLMAP's least number of trials, 100, costs as much as the matching and finds the same inliers.
FEWEST_TRIALS = 30

# COLMAP reports no progress while it finds or matches features, and its database must not be looked into
# meanwhile (a second SQLite in the process breaks its locks): it gets the work in portions of seconds.
IMAGES_PER_CALL = 8
PAIRS_PER_CALL = 256

# What a feature and a match take in the database at most, and the log beside it until its pages are moved.
# COLMAP ends the process when the disk is full: the room is checked before each call.
BYTES_PER_FEATURE, BYTES_PER_MATCH = 160, 16
LOG_BYTES = 16 << 20


@dataclass(frozen=True)
class ImageSet:
    """The images as COLMAP names them: paths below a common folder.

    Attributes:
        root: the folder above all images.
        names: path of each image relative to ``root``, in the order of the recording.
        intrinsics: camera of each image.
    """

    root: Path
    names: tuple[str, ...]
    intrinsics: tuple[Intrinsics, ...]

    @staticmethod
    def of(frames: Sequence[Frame]) -> "ImageSet":
        """Return the images of ``frames``."""
        files = [frame.path(Layer.IMAGE).resolve() for frame in frames]
        root = Path(os.path.commonpath([path.parent for path in files]))
        names = tuple(path.relative_to(root).as_posix() for path in files)
        return ImageSet(root, names, tuple(frame.camera.intrinsics for frame in frames))


def quiet_pycolmap() -> Any:
    """Return pycolmap, which from then on says nothing: progress bars and our own messages do."""
    pycolmap = import_pycolmap()
    pycolmap.logging.minloglevel = int(pycolmap.logging.FATAL)
    return pycolmap


def extract_features(
    images: ImageSet, config: SfmConfig, threads: int, database: Path, masks: Path | None = None
) -> None:
    """Find SIFT features in all images that have none yet; none where a mask below ``masks`` is black.

    Raises:
        DigsError: an image that COLMAP cannot read.
    """
    pycolmap = quiet_pycolmap()
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = threads
    options.max_image_size = config.feature_size
    options.sift.max_num_features = config.features
    options.sift.first_octave = -1 if seeks_in_enlarged(images, config) else 0
    shared = len(set(images.intrinsics)) == 1
    mode = pycolmap.CameraMode.SINGLE if shared else pycolmap.CameraMode.PER_IMAGE
    with progress(len(images.names), "Finding features", "image") as bar:
        for first in range(0, len(images.names), IMAGES_PER_CALL):
            names = list(images.names[first : first + IMAGES_PER_CALL])
            check_room(database, LOG_BYTES + len(names) * config.features * BYTES_PER_FEATURE)
            reader = _reader_options(pycolmap, images.intrinsics[0] if shared else None, database)
            if masks is not None:
                reader.mask_path = masks
            paths = database, images.root
            run_interruptible(
                partial(pycolmap.extract_features, *paths, names, mode, reader, options)
            )
            bar.update(len(names))
    if not shared:
        _write_intrinsics(images, database)
    _check_all_images_were_read(images, database)


def seeks_in_enlarged(images: ImageSet, config: SfmConfig) -> bool:
    """Return whether features are also sought in the images enlarged twice: by default in small ones."""
    if config.double_size is not None:
        return config.double_size
    longest = max(max(k.width, k.height) for k in images.intrinsics)
    return min(longest, config.feature_size) <= thresholds.MAX_SIDE_ENLARGED


def _reader_options(pycolmap: Any, shared: Intrinsics | None, database: Path) -> Any:
    """Return how images enter the database: with the one camera that they share, or one camera each."""
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = "PINHOLE"
    if shared is not None:
        reader.camera_params = ",".join(
            repr(v) for v in (shared.fx, shared.fy, shared.cx, shared.cy)
        )
        with pycolmap.Database.open(database) as db:
            known = db.read_all_cameras()
        if known:
            reader.existing_camera_id = known[0].camera_id
    return reader


def _write_intrinsics(images: ImageSet, database: Path) -> None:
    """Give every image its own known camera."""
    with quiet_pycolmap().Database.open(database) as db:
        by_name = {image.name: image for image in db.read_all_images()}
        for name, k in zip(images.names, images.intrinsics, strict=True):
            camera = db.read_camera(by_name[name].camera_id)
            camera.params = [k.fx, k.fy, k.cx, k.cy]
            camera.has_prior_focal_length = True
            db.update_camera(camera)


def _check_all_images_were_read(images: ImageSet, database: Path) -> None:
    with quiet_pycolmap().Database.open(database) as db:
        known = {image.name for image in db.read_all_images()}
    missing = [name for name in images.names if name not in known]
    if missing:
        raise DigsError(
            f"structure from motion: {len(missing)} of {len(images.names)} images cannot be read, the first "
            f"is '{images.root / missing[0]}'; export them again as 8-bit PNG or JPEG"
        )


def read_descriptors(images: ImageSet, database: Path) -> list[np.ndarray]:
    """Return the SIFT descriptors of each image, shape (features, 128), uint8."""
    with quiet_pycolmap().Database.open(database) as db:
        ids = {image.name: image.image_id for image in db.read_all_images()}
        return [np.asarray(db.read_descriptors(ids[name]).data) for name in images.names]


def match_pairs(
    images: ImageSet,
    pairs: Sequence[tuple[int, int]],
    config: SfmConfig,
    threads: int,
    database: Path,
) -> None:
    """Match the features of the given pairs and keep what one relative pose explains."""
    pycolmap = quiet_pycolmap()
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads = threads
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = config.sfm_seed
    verification.ransac.min_num_trials = FEWEST_TRIALS
    pair_list = database.with_name("pairs.txt")
    pairing = pycolmap.ImportedPairingOptions()
    pairing.match_list_path = pair_list
    with progress(len(pairs), "Matching", "pair") as bar:
        for first in range(0, len(pairs), PAIRS_PER_CALL):
            some = pairs[first : first + PAIRS_PER_CALL]
            check_room(database, LOG_BYTES + len(some) * config.features * BYTES_PER_MATCH)
            lines = [f"{images.names[i]} {images.names[j]}\n" for i, j in some]
            write_atomically(pair_list, "".join(lines).encode())
            run_interruptible(
                partial(pycolmap.match_image_pairs, database, options, pairing, verification)
            )
            bar.update(len(some))
    remove(pair_list)


# All images are adjusted together when their number, or that of the points, has grown by this factor.
GLOBAL_ADJUSTMENT_GROWTH = 1.4
# Share by which the error has to fall in a step of an adjustment for another step to follow.
LEAST_GAIN = 1e-5


def map_images(
    images: ImageSet, config: SfmConfig, threads: int, database: Path, folder: Path
) -> list[Any]:
    """Place the cameras and return all models that came out, the largest first.

    Returns:
        pycolmap.Reconstruction objects; COLMAP also writes them into ``folder``.
    """
    pycolmap = quiet_pycolmap()
    pycolmap.set_random_seed(config.sfm_seed)
    folder.mkdir(parents=True, exist_ok=True)
    placed: list[int] = []  # counted on COLMAP's thread, shown by this one
    call = partial(
        pycolmap.incremental_mapping,
        *(database, images.root, folder, incremental_options(pycolmap, config, threads)),
        initial_image_pair_callback=lambda: placed.append(2),
        next_image_callback=lambda: placed.append(1),
    )
    with progress(len(images.names), "Placing cameras", "image") as bar:
        models = run_interruptible(call, lambda: _show(bar, sum(placed)))
    return sorted(models.values(), key=lambda model: -model.num_reg_images())


def incremental_options(pycolmap: Any, config: SfmConfig, threads: int) -> Any:
    """Return how COLMAP places cameras one by one, and triangulates points."""
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = threads
    options.random_seed = config.sfm_seed
    options.min_model_size = thresholds.MIN_IMAGES
    # Bundle adjustment of all images runs as often as COLMAP itself has it for videos, and stops where it no
    # longer gains: on 14 photographs of 1600x900 that saves a quarter of the time at the same errors.
    options.ba_global_frames_ratio = options.ba_global_points_ratio = GLOBAL_ADJUSTMENT_GROWTH
    options.ba_global_function_tolerance = options.ba_local_function_tolerance = LEAST_GAIN
    # A capture's images are free of distortion.
    options.ba_refine_focal_length = config.refine_focal
    options.ba_refine_extra_params = False
    options.mapper.abs_pose_refine_focal_length = config.refine_focal
    options.mapper.abs_pose_refine_extra_params = False
    return options


def triangulate(
    images: ImageSet,
    world_from_cams: Sequence[np.ndarray],
    config: SfmConfig,
    threads: int,
    database: Path,
    folder: Path,
) -> Any:
    """Return the model of the given poses (4, 4) with the points that the matches give in them."""
    pycolmap = quiet_pycolmap()
    model = _model_of_known_poses(pycolmap, images, world_from_cams, database)
    options = incremental_options(pycolmap, config, threads)
    folder.mkdir(parents=True, exist_ok=True)
    paths = database, images.root, folder
    with progress(len(images.names), "Triangulating", "image") as bar:
        model = run_interruptible(
            partial(pycolmap.triangulate_points, model, *paths, options=options)
        )
        _show(bar, bar.total)
    model.extract_colors_for_all_images(images.root)
    return model


def _model_of_known_poses(
    pycolmap: Any, images: ImageSet, world_from_cams: Sequence[np.ndarray], database: Path
) -> Any:
    model = pycolmap.Reconstruction()
    with pycolmap.Database.open(database) as db:
        by_name = {image.name: image for image in db.read_all_images()}
        for camera in db.read_all_cameras():
            model.add_camera_with_trivial_rig(camera)
    for name, world_from_cam in zip(images.names, world_from_cams, strict=True):
        known = by_name[name]
        image = pycolmap.Image(name=name, camera_id=known.camera_id, image_id=known.image_id)
        pose = pycolmap.Rigid3d(invert_rigid(world_from_cam)[:3])
        model.add_image_with_trivial_frame(image, pose)
    return model


def _show(bar: Any, count: int) -> None:
    bar.update(min(count, bar.total) - bar.n)
