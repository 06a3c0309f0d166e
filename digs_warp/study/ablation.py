"""`digs-warp bench init-ablation`: what each component of the initialization is worth.

The study that the paper leaves to future work (its section 5): one component is taken out, or one of our
extensions is added, and points and first iterations are compared. The masks that the initialization sees
are those of a segmentation that leaks: every other one has a border that is too wide and takes in a piece
of the background, as in the paper's figure 6. Poses come from a model of structure from motion made of the
truth, whose scale is recovered from the noisy depth. Training sees the true masks: only its start differs.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from digs_warp.capture import Capture, Frame
from digs_warp.images import write_image
from digs_warp.init.config import InitConfig
from digs_warp.init.local_scales import local_scales
from digs_warp.init.recipes import initialize
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.log import progress
from digs_warp.point_cloud import PointCloud
from digs_warp.posed_frames import with_cameras
from digs_warp.sfm_model import SfmModel
from digs_warp.study.init_cases import InitCase, render_case, training_frames
from digs_warp.study.init_strategies import ScaledCapture, scaled
from digs_warp.study.results import Result
from digs_warp.study.synthetic_sfm import sfm_from_truth
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import load_test_views, mean_score, render_views, score_views
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from sim.config import SimulateConfig

FRAMES, WIDTH = 24, 640
ITERATIONS = (100,)
SFM_PER_METRE = 1.37

# How the spoiled masks leak: the border grows by pixels, and a corner of the image joins (share of a side).
GROWN_PX = 6
LEAK_SHARE = 0.25

# A voxel [m] so small that no two measurements share one.
TINY_VOXEL = 1e-5

PAPER = InitConfig(min_support=0.0, visibility_check=False)


@dataclass(frozen=True)
class Variant:
    """One row of the table.

    Attributes:
        name: what differs from the paper's recipe.
        config: of the initialization.
        use_masks: whether the initialization sees the leaking masks; else all of an image is object.
        scale: how the ratios d*/d become one scale.
        thinned: whether only as many points as the first row has are kept, at random.
    """

    name: str
    config: InitConfig = PAPER
    use_masks: bool = True
    scale: Literal["mode", "mean"] = "mode"
    thinned: bool = False


VARIANTS = (
    Variant("paper"),
    Variant("no masks", use_masks=False),
    Variant("no edge filter", replace(PAPER, edge_filter=False)),
    Variant("no k-means", replace(PAPER, foreground_filter=False)),
    Variant("k-means, equal weights", replace(PAPER, background_weight=1.0)),
    Variant("mean scale, not mode", scale="mean"),
    Variant("no voxel grid", replace(PAPER, voxel_size=TINY_VOXEL), thinned=True),
    Variant("+ minimal support", InitConfig(visibility_check=False)),
    Variant("+ uncertainty weights", replace(PAPER, weight_by_uncertainty=True)),
    Variant("+ confidence weights", replace(PAPER, weight_by_confidence=True)),
    Variant("+ visibility check", replace(PAPER, visibility_check=True)),
    Variant("+ flat Gaussians", replace(PAPER, shape="flat")),
    Variant("+ Gaussians along rays", replace(PAPER, shape="ray")),
    Variant("+ both (our default)", InitConfig()),
)


def init_ablation(
    frames: int = FRAMES,
    width: int = WIDTH,
    iterations: Sequence[int] = ITERATIONS,
    variants: Sequence[Variant] = VARIANTS,
) -> list[Result]:
    """Return points, distances [mm] and PSNR [dB] of every variant.

    Args:
        frames: of the recording of the built-in object; every eighth is held out.
        width: of its images [px].
        iterations: of training after which the held-out views are compared, ascending; none: no training.
        variants: the rows of the table.
    """
    config = SimulateConfig(frames=frames, width=width, samples_per_pixel=1)
    results: list[Result] = []
    first_count = 0
    with tempfile.TemporaryDirectory() as name, progress(len(variants), "Comparing") as bar:
        case = render_case(config, Path(name))
        capture = case.capture()
        sfm = sfm_from_truth(capture.frames, SFM_PER_METRE)
        leaking = with_leaking_masks(capture, Path(name) / "leaking")
        unmasked = without_masks(capture, Path(name) / "unmasked")
        for variant in variants:
            seen = _seen(variant, leaking if variant.use_masks else unmasked, sfm)
            points = initialize(
                seen.frames, variant.config, seen.sfm, seen.sfm_per_metre, case.baseline
            ).points
            first_count = first_count or len(points)
            if variant.thinned:
                points = _thinned(points, first_count)
            rows = [
                *_distances(case, points, seen),
                *_training(points, variant.config, seen, capture, iterations),
            ]
            results += [replace(row, settings={"variant": variant.name}) for row in rows]
            bar.update()
    return results


def with_leaking_masks(capture: Capture, folder: Path) -> Capture:
    """Return the capture with every other training mask grown and joined by a piece of background."""
    from scipy.ndimage import binary_dilation

    def leak(number: int, frame: Frame) -> Frame:
        if number % 8 == 0 or number % 2 == 0:
            return frame
        mask = frame.load_mask()
        grown = binary_dilation(mask > 0, iterations=GROWN_PX)
        height, width = mask.shape
        grown[: int(LEAK_SHARE * height), : int(LEAK_SHARE * width)] = True
        return _with_mask(frame, np.where(grown, 255, mask).astype(np.uint8), folder)

    return replace(capture, frames=tuple(leak(i, f) for i, f in enumerate(capture.frames)))


def without_masks(capture: Capture, folder: Path) -> Capture:
    """Return the capture with masks that call everything object."""
    k = capture.frames[0].camera.intrinsics
    everything = np.full((k.height, k.width), 255, np.uint8)
    return replace(
        capture, frames=tuple(_with_mask(frame, everything, folder) for frame in capture.frames)
    )


def _with_mask(frame: Frame, mask: np.ndarray, folder: Path) -> Frame:
    path = folder / f"{frame.name}.png"
    write_image(path, mask)
    return replace(frame, files={**frame.files, "mask_path": path})


def _seen(variant: Variant, capture: Capture, sfm: SfmModel) -> ScaledCapture:
    if variant.scale == "mode":
        return scaled(capture, sfm, SFM_PER_METRE)
    ratios = local_scales(sfm, training_frames(capture), variant.config)
    return scaled(capture, sfm, SFM_PER_METRE, found=float(ratios.mean()))


def _thinned(points: PointCloud, count: int) -> PointCloud:
    chosen = np.random.default_rng(0).choice(len(points), size=count, replace=False)
    return PointCloud(points.points_world[chosen], points.colors[chosen])


def _distances(case: InitCase, points: PointCloud, seen: ScaledCapture) -> Iterator[Result]:
    score = case.score(points.points_world * np.float32(seen.true_per_metre))
    yield Result("points", len(points), "points")
    yield Result("Chamfer [mm]", 1e3 * score.chamfer, "mm")
    yield Result("to surface [mm]", 1e3 * score.accuracy, "mm")
    yield Result("median [mm]", 1e3 * score.accuracy_median, "mm")
    yield Result("from surface [mm]", 1e3 * score.completeness, "mm")


def _training(
    points: PointCloud,
    init: InitConfig,
    seen: ScaledCapture,
    capture: Capture,
    iterations: Sequence[int],
) -> Iterator[Result]:
    """Train on the views with their true masks and measure the held-out ones on the way."""
    if not iterations:
        return
    config = TrainConfig(iterations=iterations[-1])
    training, held_out = capture.split()
    views = open_views(with_cameras(training, seen.sfm), config)
    seeds = seed_gaussians(points, config.sh_degree, init.seed_opacity, init.seed_width)
    trainer = Trainer(seeds, views, config)
    test_views = load_test_views(with_cameras(held_out, seen.sfm))
    for stop in iterations:
        while trainer.optimizer.step < stop:
            trainer.step()
        scores = score_views(render_views(trainer.gaussians, test_views), test_views)
        yield Result(f"PSNR at {stop} [dB]", mean_score(scores)["psnr"] or float("nan"), "dB")
    views.close()
