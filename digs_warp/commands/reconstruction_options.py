"""What `digs-warp run` and `digs-warp reconstruct` share: flags, and words of results."""

from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import tyro

from digs_warp.init.config import STRATEGIES, InitConfig, StrategyChoice, chosen_strategy
from digs_warp.masks.config import SegmentConfig
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.settings import TEST_EVERY, Settings
from digs_warp.train.config import Density, DensityStrategy, Stop, TrainConfig
from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.data.capture import Capture
    from digs_warp.pipeline.reconstruct import ReconstructConfig
    from digs_warp.pipeline.reconstruction import Reconstruction

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class _InitOptions(InitConfig):
    """Which points the Gaussians start from."""

    strategy: StrategyChoice = "auto"  # pyright: ignore
    """Where the points come from. auto: highdepth, without depth mvs. highdepth: depth maps in fine voxels;
    depth: in coarse voxels; mvs: depth by matching photographs, or where that fails hull (objects) or default
    (scenes); hull: where all masks agree; default: the paper's name for sparse points, recorded or matched;
    fusion: depth and sparse points, for fine texture; random: random points, for comparison."""


@dataclass(frozen=True, kw_only=True)
class _DensityOptions(Density):
    """How the number of Gaussians changes during a run."""

    strategy: Annotated[Literal["auto", DensityStrategy], tyro.conf.arg(name="density")] = "auto"  # pyright: ignore
    """How the number of Gaussians changes. auto: fixed after a start from depth, adaptive after a sparse or
    random one; fixed: not at all; adaptive: clone, split, prune and reset as in 3DGS."""


# Its groups have empty names, so that the help shows them as one. (Not said in the class: tyro shows that.)
@dataclass(frozen=True, kw_only=True)
class _TrainOptions(TrainConfig):
    """How the Gaussians are optimized."""

    stop: Annotated[Stop, tyro.conf.arg(name="")] = field(default_factory=Stop)
    density: Annotated[_DensityOptions, tyro.conf.arg(name="")] = field(
        default_factory=_DensityOptions
    )


@dataclass(frozen=True, kw_only=True)
class ReconstructionOptions(Settings):
    """The part of a command that says how a capture becomes Gaussians; named as in `ReconstructConfig`.

    One seed serves all stages: `reconstruct_config` takes it.
    """

    sfm: Annotated[SfmConfig, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="poses")] = field(
        default_factory=lambda: SfmConfig(poses="capture")
    )
    segment: Annotated[SegmentConfig, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="masks")] = (
        field(default_factory=SegmentConfig)
    )
    init: Annotated[
        _InitOptions, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="initialization")
    ] = field(default_factory=_InitOptions)
    train: Annotated[_TrainOptions, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="training")] = (
        field(default_factory=_TrainOptions)
    )
    subject: Literal["auto", "object", "scene"] = "auto"
    """What is reconstructed. object: what lies in the masks; scene: everything in view; auto: the object if
    the recording has masks or --masks makes some, else the scene."""

    test_every: Annotated[int, TEST_EVERY] = 8
    """The middle one of every n views is held out: it trains nothing and measures the result. 2 or more,
    so that some views train."""

    def reconstruct_config(
        self, seed: int, capture: "Capture | None" = None
    ) -> "ReconstructConfig":
        """Return the settings; ``seed`` serves all stages.

        Args:
            seed: decides everything random.
            capture: the recording, by which 'auto' decides; None: a simulated one, which has depth.
        """
        from digs_warp.pipeline.config import ReconstructConfig, subject_of

        start = chosen_strategy(self.init.strategy, capture is None or capture.has_depth)
        strategy = self.train.density.strategy
        is_scene = capture and subject_of(capture, self.subject, self.segment) == "scene"
        if strategy == "auto":
            strategy = "fixed" if start == "mvs" and is_scene else STRATEGIES[start].density
        density = _plain(self.train.density, Density, strategy=strategy)
        return ReconstructConfig(
            sfm=replace(self.sfm, sfm_seed=seed),
            segment=self.segment,
            init=_plain(self.init, InitConfig, strategy=start),
            train=_plain(self.train, TrainConfig, seed=seed, density=density),
            subject=self.subject,
            test_every=self.test_every,
        )


def _plain(options: Any, kind: type[T], **changes: Any) -> T:
    """Return the settings behind flags, with ``changes`` such as the common seed."""
    values = {f.name: getattr(options, f.name) for f in fields(kind)}  # pyright: ignore[reportArgumentType]
    return kind(**(values | changes))


def reconstruction_words(result: "Reconstruction", frames: int) -> str:
    """Say how many Gaussians there are, from what, and how good they are."""
    depth = result.start.depth if result.start else None
    scale = result.poses.metric_scale
    is_known = scale is None or scale.known
    voxels = ""
    if depth:
        size = f"{1e3 * depth.voxel_size:.3g} mm" if is_known else f"{depth.voxel_size:.3g} units"
        voxels = f" in voxels of {size}"
    gaussians = counted(len(result.gaussians), "Gaussian")
    unknown = [] if is_known else ["scale unknown"]
    words = [f"{gaussians} from {counted(frames, 'frame')}{voxels}", result.quality]
    words += [str(result.scores.surface)] if result.scores.surface else []
    adherence = result.training.adherence
    words += [f"adherence to the measured depth {1e3 * adherence:.2f} mm"] if adherence else []
    return ", ".join(words + unknown)
