"""Record a scene with the stereo camera: mesh and environment in, capture folder out."""

import json
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from digs_warp.camera import Camera
from digs_warp.capture import (
    INDEX_NAME,
    Capture,
    CaptureWriter,
    FrameImages,
    Rig,
    file_hashes,
)
from digs_warp.checks import DigsError, check_positive
from digs_warp.log import RunLog, progress, read_json, to_json
from sim.environment import Environment, load_environment, procedural_environment
from sim.rig import StereoRig, zed2_like
from sim.scene import Scene
from sim.sensor.law import sense_depth
from sim.trajectory import fitting_distance, handheld_orbits

if TYPE_CHECKING:
    from sim.render.raycast import RaycastRenderer

RUN_NAME = "run.json"

# Room between the object and the nearest depth that the sensor reports, as a share of its radius.
NEAR_MARGIN = 1.2

# The walls stand at least this many orbit distances away.
SURROUND_MARGIN = 2.0

# Identify the eyes' pixel sampling in the seeds, apart from the ids of the sensor's effects.
LEFT_EYE, RIGHT_EYE = 101, 102

# Frames that may wait for the disk while the next ones are rendered; bounds the memory.
WRITE_QUEUE = 4


@dataclass(frozen=True, kw_only=True)
class SimulateConfig:
    """What to record and how. The same settings give the same bytes."""

    mesh: Path | None = None
    """The object: GLB, glTF, OBJ, PLY or STL. Default: the built-in object."""

    environment: Path | None = None
    """The surround and its light: an equirectangular HDR, EXR, PNG or JPG. Default: a built-in room."""

    frames: int = 60
    """Number of stereo frames, uniformly spaced in time over three orbits."""

    width: int = 640
    """Image width [px]."""

    height: int = 360
    """Image height [px]."""

    samples_per_pixel: int = 4
    """Rays averaged in each pixel; more give smoother edges and take longer."""

    tier: Literal["truth", "law"] = "law"
    """Depth sensor: 'truth' reports exact depth, 'law' adds the noise, steps and range of a stereo pair."""

    strength: float = 1.0
    """Factor on the errors of the depth sensor; 0: none, 2: twice as bad as the real one."""

    object_size: float | None = None
    """Size of the object's longest side [m]. Default: chosen from the mesh, so that it fits a table."""

    up: Literal["auto", "y", "z"] = "auto"
    """Which axis of the mesh file points up."""

    seed: int = 0
    """Seed of hand shake, pixel sampling and depth noise."""

    def __post_init__(self) -> None:
        for name in ("frames", "width", "height", "samples_per_pixel"):
            if getattr(self, name) < 1:
                raise DigsError(f"{name}: {getattr(self, name)}, expected at least 1")
        if self.seed < 0:
            raise DigsError(f"seed: {self.seed}, expected 0 or more")
        if not (np.isfinite(self.strength) and self.strength >= 0):
            raise DigsError(f"strength: {self.strength}, expected a finite number, 0 or more")
        if self.object_size is not None:
            check_positive("object_size [m]", self.object_size)
        if self.mesh is None and (self.object_size is not None or self.up != "auto"):
            raise DigsError(
                "object_size and up say how to take a mesh file; the built-in object has its own size: "
                "leave them out, or name a mesh"
            )


def simulate(config: SimulateConfig, folder: Path, resume: bool = False) -> Capture:
    """Render and sense every frame, and write the capture folder.

    Args:
        config: what to record.
        folder: where to; created when missing.
        resume: go on where a run with the same settings was cut off: complete frames are kept, and the
            result is the same, byte for byte.

    Raises:
        DigsError: bad input, a folder that holds another recording, or settings that differ on resume.
    """
    folder = Path(folder)
    log = RunLog("simulate", config)
    _claim_folder(folder, config, resume)
    with log.stage("load"):
        scene, environment = _load(config)
    log.save(folder / RUN_NAME)  # from here on the folder belongs to these settings
    with log.stage("prepare"):
        from sim.render.raycast import RaycastRenderer

        rig = zed2_like(config.width, config.height)
        distance = _orbit_distance(scene, rig)
        radius = max(environment.radius, SURROUND_MARGIN * distance)
        renderer = RaycastRenderer(scene, Environment(environment.radiance, radius))
        poses = handheld_orbits(config.frames, distance, config.seed)
    writer = CaptureWriter(folder, rig.intrinsics, Rig(rig.baseline))
    _record(_Recorder(config, rig, renderer), poses, writer, log)
    capture = writer.finish(
        {
            "tier": config.tier,
            "seed": config.seed,
            "object_radius": scene.radius,
            "surround_radius": radius,
            "exposure": renderer.exposure,
            "sensor": {key: value for key, value in asdict(rig).items() if key != "intrinsics"},
        }
    )
    log.results = {"frames": len(capture), "seed": config.seed, "sha256": file_hashes(folder)}
    log.save(folder / RUN_NAME)
    return capture


@dataclass(frozen=True)
class _Recorder:
    """Makes the images of one frame; frames do not depend on each other."""

    config: SimulateConfig
    rig: StereoRig
    renderer: "RaycastRenderer"

    def render(self, number: int, left: Camera) -> FrameImages:
        """Return both eyes, the mask and the true depth (which stands in for the sensed one)."""
        samples = self.config.samples_per_pixel
        view = self.renderer.render(left, samples, self._pixel_seed(number, LEFT_EYE))
        right, _ = self.renderer.render_image(
            left.shifted_right(self.rig.baseline), samples, self._pixel_seed(number, RIGHT_EYE)
        )
        return FrameImages(view.image, view.depth, view.mask, right, view.depth)

    def sense(self, number: int, images: FrameImages) -> FrameImages:
        """Return the images with the depth that the sensor reports."""
        strength = self.config.strength
        if self.config.tier == "truth" or strength == 0:
            return images
        rig = replace(
            self.rig,
            disparity_sigma=strength * self.rig.disparity_sigma,
            disparity_step=strength * self.rig.disparity_step,
        )
        depth = sense_depth(images.depth, rig, self.config.seed, number)
        return FrameImages(images.image, depth, images.mask, images.right, images.depth_true)

    def _pixel_seed(self, number: int, eye: int) -> int:
        sequence = np.random.SeedSequence([self.config.seed, number, eye])
        return int(sequence.generate_state(1)[0])


def _record(
    recorder: _Recorder,
    poses: Sequence[tuple[np.ndarray, float]],
    writer: CaptureWriter,
    log: RunLog,
) -> None:
    """Render and sense the frames that are not there yet, and write them beside the rendering.

    The time noted for writing is that of the writing threads: most of it passes while rays are cast.
    """
    log.seconds.update({"render": 0.0, "sense": 0.0, "write": 0.0})
    missing = [number for number in range(len(poses)) if not writer.has_frame(number)]
    pending: list[Future[float]] = []

    def settle(limit: int) -> None:
        while len(pending) > limit:
            log.seconds["write"] += pending.pop(0).result()

    with (
        ThreadPoolExecutor(2, thread_name_prefix="write") as pool,
        progress(len(poses), "Recording", "frame", len(poses) - len(missing)) as bar,
    ):
        for number in missing:
            with log.stage("render"):
                camera = Camera(recorder.rig.intrinsics, poses[number][0])
                images = recorder.render(number, camera)
            with log.stage("sense"):
                images = recorder.sense(number, images)
            pending.append(pool.submit(_timed_write, writer, number, images))
            settle(WRITE_QUEUE)
            bar.update()
        settle(0)
    for number, (world_from_cam, moment) in enumerate(poses):
        writer.add_pose(number, world_from_cam, moment)


def _timed_write(writer: CaptureWriter, number: int, images: FrameImages) -> float:
    start = time.perf_counter()
    writer.write_frame(number, images)
    return time.perf_counter() - start


def _claim_folder(folder: Path, config: SimulateConfig, resume: bool) -> None:
    """Refuse a folder that holds another recording."""
    record = folder / RUN_NAME
    if not record.exists() and not (folder / INDEX_NAME).exists():
        return
    if not (resume and record.exists()):
        raise DigsError(
            f"capture '{folder}': the folder already holds a recording; resume it if it was cut off, "
            "or choose another folder"
        )
    before = read_json(record, "run record").get("settings", {})
    now: dict[str, Any] = _plain_settings(config)
    different = sorted(key for key in now | before if now.get(key) != before.get(key))
    if different:
        changes = ", ".join(f"{key} {before.get(key)} -> {now.get(key)}" for key in different)
        raise DigsError(
            f"capture '{folder}': begun with other settings ({changes}); resume with the same ones, "
            "or record into another folder"
        )


def _plain_settings(config: SimulateConfig) -> dict[str, Any]:
    """Return the settings as they read back from run.json."""
    return json.loads(to_json(config))


def _load(config: SimulateConfig) -> tuple[Scene, Environment]:
    if config.mesh is None:
        from sim.procedural import procedural_scene

        scene = procedural_scene()
    else:
        from sim.load import load_scene

        scene = load_scene(config.mesh, config.object_size, config.up)
    if config.environment is None:
        return scene, procedural_environment()
    return scene, load_environment(config.environment)


def _orbit_distance(scene: Scene, rig: StereoRig) -> float:
    """Return the distance at which the object fits the image and no part is too near for the sensor."""
    fitting = fitting_distance(scene.radius, rig.intrinsics)
    return max(fitting, rig.min_depth + NEAR_MARGIN * scene.radius)
