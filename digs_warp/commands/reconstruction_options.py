"""Flags of the reconstruction, as `digs-warp run` and `digs-warp reconstruct` share them."""

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import tyro

from digs_warp.init.config import InitConfig
from digs_warp.sfm.config import SfmConfig
from digs_warp.train.config import TrainConfig

if TYPE_CHECKING:
    from digs_warp.reconstruct import ReconstructConfig

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class SfmOptions(SfmConfig):
    """Where camera poses and sparse points come from.

    Images are matched only with --poses sfm, or for a strategy that starts from sparse points.
    """

    poses: Literal["sfm", "capture", "perturbed"] = "capture"
    """Poses: 'capture' takes those of the recording; 'sfm' estimates them from the images, and their scale
    from the depth maps; 'perturbed' moves every camera of the recording by a random error."""

    # One --seed serves all stages.
    seed: Annotated[int, tyro.conf.Fixed, tyro.conf.Suppress] = 0


@dataclass(frozen=True, kw_only=True)
class _TrainOptions(TrainConfig):
    """How the Gaussians are optimized."""

    seed: Annotated[int, tyro.conf.Fixed, tyro.conf.Suppress] = 0


@dataclass(frozen=True, kw_only=True)
class ReconstructionOptions:
    """The part of a command that says how a capture becomes Gaussians."""

    poses: Annotated[SfmOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SfmOptions)
    initialization: Annotated[InitConfig, tyro.conf.OmitArgPrefixes] = field(
        default_factory=InitConfig
    )
    training: Annotated[_TrainOptions, tyro.conf.OmitArgPrefixes] = field(
        default_factory=_TrainOptions
    )
    test_every: int = 8
    """Every n-th view, from the first on, is held out: it trains nothing and measures the result."""

    def reconstruct_config(self, seed: int) -> "ReconstructConfig":
        """Return the settings; ``seed`` serves all stages."""
        from digs_warp.reconstruct import ReconstructConfig

        return ReconstructConfig(
            sfm=_plain(self.poses, SfmConfig, seed),
            init=self.initialization,
            train=_plain(self.training, TrainConfig, seed),
            test_every=self.test_every,
        )


def _plain(options: Any, kind: type[T], seed: int) -> T:
    """Return the settings behind flags, with the common seed."""
    values = {f.name: getattr(options, f.name) for f in fields(kind)}  # pyright: ignore[reportArgumentType]
    return kind(**(values | {"seed": seed}))
