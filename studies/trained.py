"""`python -m studies trained`: what can be done with a trained object, and how well.

The built-in object is recorded and trained for a short while (not timed). Then it is turned into meshes at
several voxel sizes, written in every file format, and drawn as other programs draw its files.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, Gaussians
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.formats.splats.files import AS_IT_IS, SplatWriting
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.init.seeds import seed_gaussians
from digs_warp.measure.metrics import psnr
from digs_warp.measure.surface_metrics import surface_score
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.scene_files import read_scene, write_scene_file
from digs_warp.record.progress import progress
from digs_warp.show.film.camera_path import find_subject, orbit
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import render
from digs_warp.study.engine.case import STUDIED_CAMERA
from digs_warp.study.engine.scores import psnr_with_one_gain
from digs_warp.study.scenes import VOXEL
from digs_warp.surface.extract import Scene, extract_surface
from digs_warp.surface.true_surface import read_true_surface
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.evaluate import TestView, load_test_views, render_views
from digs_warp.train.smoothing import for_classic_viewers
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from digs_warp.usd.writer import write_gaussians
from studies.results import Result
from studies.timing import Stopwatch

TRAINING_FRAMES, TRAINING_STEPS, SH_DEGREE = 48, 400, 3

FOV_DEG = 45.0

# Meshes: voxel sizes [m] for an object half a metre high, and the distance [m] of the F-score.
VOXELS = (0.008, 0.004, 0.003, 0.002)
NEAR = 0.005

# Files: name, suffix, how; compared in views of this size [px], where alpha exceeds COVERED.
FORMATS = (
    *(("npz", ".npz", AS_IT_IS), ("PLY", ".ply", AS_IT_IS), ("glTF", ".glb", AS_IT_IS)),
    *(("USD", ".usdz", AS_IT_IS), (".splat", ".splat", AS_IT_IS), ("SOG", ".sog", AS_IT_IS)),
    ("compressed PLY", ".compressed.ply", AS_IT_IS),
    ("SPZ", ".spz", AS_IT_IS),
    *((f"SPZ, bits {a} {a}", ".spz", SplatWriting(spz_sh_bits=(a, a))) for a in (6, 8)),
    ("USD, mixed", ".usdz", None),
)
# Viewers: images that a perfect camera takes, as shares of the width of the training images, and samples for
# each of their pixels.
TRAINING_SIZE = (640, 360)
TRUE_SIZES = (("1/2", 0.5, 16), ("1", 1.0, 4), ("4/3", 4 / 3, 4), ("2", 2.0, 4))
TRUE_VIEWS = 8

VIEWS = 4
VIEW_SIZE = (960, 540)
COVERED = 0.5


@dataclass(frozen=True, eq=False)
class TrainedObject:
    """The Gaussians, the cameras that recorded them, the true surface, and true views by their size."""

    gaussians: Gaussians
    cameras: list[Camera]
    surface: TriangleMesh
    truth: Mapping[str, Sequence[TestView]] = field(default_factory=dict)


def trained_object() -> TrainedObject:
    """Record the built-in object, start from its depth and train; always the same."""
    from digs_warp.sim.record.record import SimulateConfig, simulate

    width, height = TRAINING_SIZE
    recording = SimulateConfig(
        profile=STUDIED_CAMERA,
        frames=TRAINING_FRAMES,
        width=width,
        height=height,
        samples_per_pixel=1,
        tier="law",
    )
    init = InitConfig(voxel_size=VOXEL)
    train = TrainConfig(stop=Stop(iterations=TRAINING_STEPS), sh_degree=SH_DEGREE)
    with tempfile.TemporaryDirectory() as folder:
        capture = simulate(recording, Path(folder) / "capture")
        surface = read_true_surface(capture.folder)
        assert surface is not None  # it was simulated
        points = initialize(capture.frames, init).points
        seeds = seed_gaussians(
            points, train.usual_sh_degree, init.defaults.opacity, init.defaults.width
        )
        trainer = Trainer(seeds, open_views(capture.frames, train), train)
        with progress(TRAINING_STEPS, "Training", "step") as bar:
            for _ in range(TRAINING_STEPS):
                trainer.step()
                bar.update()
        cameras = [frame.camera for frame in capture.frames]
        truth = true_views(Path(folder))
        return TrainedObject(trainer.gaussians.to_numpy(), cameras, surface, truth)


def true_views(folder: Path) -> dict[str, Sequence[TestView]]:
    """Return what a perfect camera sees on another walk, by the width in widths of the training images."""
    from digs_warp.sim.record.record import SimulateConfig, simulate

    found = {}
    for name, share, samples in TRUE_SIZES:
        width, height = (round(share * side) for side in TRAINING_SIZE)
        config = SimulateConfig(
            profile=STUDIED_CAMERA,
            frames=TRUE_VIEWS,
            width=width,
            height=height,
            samples_per_pixel=samples,
            tier="truth",
            seed=20260521,
        )
        capture = simulate(config, folder / f"truth_{width}")
        found[name] = load_test_views(capture.frames)
    return found


def bench_trained() -> list[Result]:
    """Measure meshes and files of the trained object, and how others draw them."""
    trained = trained_object()
    files = measure_formats(trained.gaussians)
    return [*measure_meshes(trained), *files, *measure_viewers(trained)]


def measure_meshes(
    trained: TrainedObject, voxels: tuple[float, ...] = VOXELS, near: float = NEAR
) -> list[Result]:
    """Return seconds, triangles and distances to the true surface by voxel size [m].

    "truth to mesh" includes surface that no camera saw, such as the inside of the vase.
    """
    subject = find_subject(trained.gaussians)
    scene = Scene(subject.center_world, subject.radius)
    results = []
    with progress(len(voxels), "Measuring", "mesh") as bar:
        for voxel in voxels:
            with Stopwatch() as watch:
                mesh = extract_surface(trained.gaussians, trained.cameras, scene, voxel).mesh
            score = surface_score(mesh.points_world, trained.surface, near)
            labels = {
                "voxel [mm]": round(1e3 * voxel, 3),
                "views": len(trained.cameras),
                "splats": len(trained.gaussians),
            }
            values = {
                "time [CPU s]": watch.cpu_seconds,
                "triangles": len(mesh),
                "mesh to truth [mm]": 1e3 * score.accuracy,
                "truth to mesh [mm]": 1e3 * score.completeness,
                "Chamfer [mm]": 1e3 * score.chamfer,
                f"F-score at {1e3 * near:g} mm": score.f_score,
            }
            results.append(Result(labels, values, "meshes"))
            bar.update()
    return results


def measure_formats(gaussians: Gaussians, view_size: tuple[int, int] = VIEW_SIZE) -> list[Result]:
    """Return bytes per Gaussian, seconds per million to write and read, and PSNR by format.

    PSNR compares renders before writing and after reading, over the pixels that the object covers. Above
    40 dB the difference is hardly visible. Both are drawn with the same filter: `measure_viewers` measures
    what a viewer adds.
    """
    cameras = orbit(find_subject(gaussians), Intrinsics.from_fov(*view_size, FOV_DEG), VIEWS)
    before = [render(gaussians, camera) for camera in cameras]
    results = []
    with tempfile.TemporaryDirectory() as folder, progress(len(FORMATS), "Measuring") as bar:
        ours = Reconstruction(gaussians=gaussians)
        for name, suffix, how in FORMATS:
            path = Path(folder) / f"scene{suffix}"
            with Stopwatch() as write:
                if how is None:
                    write_gaussians(path, gaussians, precision="mixed")
                else:
                    write_scene_file(path, ours, Path("bench"), how)
            with Stopwatch() as read:
                read_back = read_scene(path).gaussians
            stored = replace(read_back, screen_filter=gaussians.screen_filter)
            scores = [
                psnr(render(stored, camera).image, view.image, view.alpha > COVERED)
                for camera, view in zip(cameras, before, strict=True)
            ]
            labels = {"format": name, "splats": len(gaussians), "degree": gaussians.sh_degree}
            values = {
                "size [B/splat]": path.stat().st_size / len(gaussians),
                "write [CPU s/million]": 1e6 * write.cpu_seconds / len(gaussians),
                "read [CPU s/million]": 1e6 * read.cpu_seconds / len(gaussians),
                "PSNR [dB]": float(np.mean(scores)),
            }
            results.append(Result(labels, values, "files"))
            bar.update()
    return results


def measure_viewers(trained: TrainedObject) -> list[Result]:
    """Return the PSNR in true views of four sizes, by the file and what its viewer adds on the screen."""
    ours = trained.gaussians
    width, height = TRAINING_SIZE
    doubled = [camera.resized(2 * width, 2 * height) for camera in trained.cameras]
    cases = (
        ("as it is", "nothing (ours, USD, ray tracers)", ours),
        ("as it is", "0.3 px²", replace(ours, screen_filter=CLASSIC)),
        ("as it is", "0.3 px², antialiased", replace(ours, screen_filter=ANTIALIASED)),
        ("--for classic", "0.3 px²", for_classic_viewers(ours, trained.cameras)),
        (f"--for classic --for-width {2 * width}", "0.3 px²", for_classic_viewers(ours, doubled)),
    )
    results = []
    with progress(len(cases), "Measuring", "viewer") as bar:
        for file, adds, gaussians in cases:
            drawn = DeviceGaussians.from_numpy(gaussians)
            values = {
                f"PSNR at {name} [dB]": psnr_with_one_gain(render_views(drawn, views), views)
                for name, views in trained.truth.items()
            }
            results.append(Result({"file": file, "the viewer adds": adds}, values, "viewers"))
            bar.update()
    return results
