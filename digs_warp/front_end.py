"""Capture -> posed frames with masks, and the points to start from (paper sections 3.1 to 3.3).

The order is the paper's: structure from motion sees whole images, background included; masks come after it;
the depth maps inside them tell the scale; then everything is metric.
"""

import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from digs_warp.capture import Capture, Frame
from digs_warp.checks import DigsError
from digs_warp.init.config import InitConfig
from digs_warp.init.local_scales import local_scales
from digs_warp.init.recipes import initialize
from digs_warp.init.scale import estimate_scale
from digs_warp.log import RunLog
from digs_warp.point_cloud import PointCloud
from digs_warp.posed_frames import CAMERAS, PosedFrames
from digs_warp.sfm.config import SfmConfig
from digs_warp.sfm_model import SfmModel

logger = logging.getLogger(__name__)

POINTS = "initial_points.npz"
SFM = "sfm"

# Strategies that start from sparse points, or from as many.
NEED_SFM = ("default", "random", "fusion")


@dataclass(frozen=True, kw_only=True)
class FrontEndConfig:
    """How a capture becomes posed frames and points."""

    sfm: SfmConfig = field(default_factory=lambda: SfmConfig(poses="capture"))
    init: InitConfig = field(default_factory=InitConfig)
    test_every: int = 8
    """Every n-th view, from the first on, is held out for the evaluation."""


@dataclass(frozen=True, eq=False)
class _Model:
    """Structure from motion in metres, and the scale it had; the scale of given poses is 1."""

    sfm: SfmModel
    sfm_per_metre: float


def front_end(
    capture: Capture, config: FrontEndConfig, folder: Path, log: RunLog, resume: bool = False
) -> tuple[PosedFrames, PointCloud]:
    """Return the frames as the reconstruction sees them, and the points that it starts from.

    Leaves cameras.json, initial_points.npz and, where structure from motion ran, its workspace in
    ``folder``; ``resume`` takes from there what is finished.

    Raises:
        DigsError: too few frames, a failed structure from motion, or nothing to initialize from.
    """
    if resume and (folder / POINTS).is_file() and (folder / CAMERAS).is_file():
        return PosedFrames.load(capture, folder), PointCloud.load(folder / POINTS)
    frames = _split(capture, config.test_every)
    model: _Model | None = None
    if config.sfm.poses != "capture" or config.init.strategy in NEED_SFM:
        frames, model = _structure_from_motion(capture, frames, config, folder, log)
    with log.stage("initialize"):
        start = initialize(
            frames.training,
            config.init,
            sfm=model.sfm if model else None,
            sfm_per_metre=model.sfm_per_metre if model else None,
            baseline=capture.rig.baseline if capture.rig else None,
        )
    log.results["initialization"] = {"sources": start.sources} | (
        asdict(start.depth) if start.depth else {}
    )
    frames.save(folder)
    start.points.save(folder / POINTS)
    return frames, start.points


def _split(capture: Capture, test_every: int) -> PosedFrames:
    training, held_out = capture.split(test_every)
    if not training:
        raise DigsError(
            f"capture '{capture.folder}': {len(capture)} frame, expected at least 2: "
            "one is held out for the evaluation"
        )
    return PosedFrames(tuple(training), tuple(held_out))


def _structure_from_motion(
    capture: Capture, frames: PosedFrames, config: FrontEndConfig, folder: Path, log: RunLog
) -> tuple[PosedFrames, _Model]:
    """Pose all frames, those held out as well: without a pose they could not be compared."""
    from digs_warp.sfm.estimate import structure_from_motion

    with log.stage("structure from motion"):
        result = structure_from_motion(capture.frames, config.sfm, folder / SFM)
    log.results["sfm"] = asdict(result.quality)
    model = _Model(result.model, 1.0)
    if not result.is_metric:
        with log.stage("scale"):
            scale = estimate_scale(local_scales(result.model, frames.training, config.init))
            model = _Model(result.model.in_metres(scale.sfm_per_metre), scale.sfm_per_metre)
        log.results["scale"] = asdict(scale)
        model = replace(model, sfm=_placed(model.sfm, capture))
    training = _registered(frames.training, model.sfm)
    if not training:
        raise DigsError(
            f"structure from motion: none of the {len(frames.training)} training frames was registered"
        )
    held_out = _registered(frames.held_out, model.sfm)
    return PosedFrames(training, held_out, model.sfm_per_metre), model


def _placed(sfm: SfmModel, capture: Capture) -> SfmModel:
    """Lay the world's axes as the recording has them."""
    from digs_warp.sfm.world import world_as_recorded

    recorded = {frame.name: frame.camera for frame in capture.frames}
    return sfm.moved(world_as_recorded(sfm.cameras, [recorded[name] for name in sfm.names]))


def _registered(frames: Sequence[Frame], sfm: SfmModel) -> tuple[Frame, ...]:
    """Return the frames that have a camera, with it; warn of the others."""
    cameras = dict(zip(sfm.names, sfm.cameras, strict=True))
    lost = [frame.name for frame in frames if frame.name not in cameras]
    if lost:
        logger.warning("%d frames were not registered and are left out: %s", len(lost), lost[:5])
    return tuple(
        replace(frame, camera=cameras[frame.name]) for frame in frames if frame.name in cameras
    )
