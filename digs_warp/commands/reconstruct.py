"""`digs-warp reconstruct`: a capture folder -> Gaussians."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import tyro

from digs_warp.bounds import check_flag
from digs_warp.commands.command import SettingsCommand
from digs_warp.commands.facts import reconstruction_words
from digs_warp.commands.output import ANY_FOLDER, OutputFolder
from digs_warp.commands.reconstruction_options import ReconstructionOptions
from digs_warp.commands.result_files import reconstruction_files
from digs_warp.commands.watched import watched_training
from digs_warp.record import layout
from digs_warp.record.settings import settings_from_json


@dataclass(frozen=True, kw_only=True)
class Reconstruct(ReconstructionOptions, SettingsCommand):
    """Reconstruct a capture as Gaussian splats.

    The depth maps give the points to start from, the images of the training views give everything else; every
    eighth view is held out and tells how good the result is.
    """

    capture: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="CAPTURE")]
    """A folder that 'digs-warp simulate' wrote, or your own recording (docs/capture-format.md)."""

    output: Annotated[OutputFolder, tyro.conf.OmitArgPrefixes]
    seed: int = 0
    """Decides everything random: matching of images, order of the views, backgrounds."""

    view: tyro.conf.FlagCreatePairsOff[bool] = False
    """Show the training in the browser while it runs; prints the page's address."""

    can_resume: ClassVar[bool] = True
    recorded_as: ClassVar[str] = "reconstruct"
    main_flags: ClassVar[tuple[str, ...]] = (
        "capture",
        "out",
        "resume",
        "overwrite",
        "seed",
        "device",
        "poses",
        "masks",
        "mask_folder",
        "strategy",
        "voxel_size",
        "target_points",
        "iterations",
        "time_budget",
        "density",
        "sh_degree",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_flag("--seed", self.seed)

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Return the command with the settings of a run.json; required flags are `tyro.MISSING`."""
        options = settings_from_json(ReconstructionOptions, settings)
        return cls(
            capture=tyro.MISSING, output=ANY_FOLDER, seed=options.train.seed, **vars(options)
        )

    def execute(self) -> str:
        """Reconstruct and say how well it went."""
        from digs_warp.data.capture import read_capture
        from digs_warp.pipeline.reconstruct import check_machine, reconstruct

        start = time.perf_counter()
        capture = read_capture(self.capture)
        config = self.reconstruct_config(self.seed, capture)
        check_machine(config)  # a wrong flag is named first
        with (
            self.output.opened([self.capture], reconstruction_files()) as folder,
            watched_training(self.view) as watch,
        ):
            result = reconstruct(capture, config, folder, self.output.resume, watch)
        seconds = time.perf_counter() - start
        words = reconstruction_words(result, len(capture))
        return f"{self.output.out / layout.GAUSSIANS}: {words}, {seconds:.1f} s"
