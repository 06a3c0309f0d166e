"""`digs-warp reconstruct`: a capture folder -> Gaussians."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import SettingsCommand
from digs_warp.commands.many_captures import find_jobs, is_data_set, make_many, reconstruct_many
from digs_warp.commands.output import ANY_FOLDER, OUTPUT_FLAGS, OutputFolder
from digs_warp.commands.precompile import compile_kernels
from digs_warp.commands.reconstruction_options import (
    ReconstructionOptions,
    reconstruction_words,
)
from digs_warp.engines.config import EngineConfig
from digs_warp.record import layout
from digs_warp.record.run_log import RunLog
from digs_warp.record.typed import from_json
from digs_warp.settings import SEED

if TYPE_CHECKING:
    from digs_warp.data.capture import Capture
    from digs_warp.pipeline.reconstruction import Reconstruction


@dataclass(frozen=True, kw_only=True)
class _Output(SettingsCommand):
    """What the help shows first: where the results go."""

    output: Annotated[OutputFolder, tyro.conf.OmitArgPrefixes]


@dataclass(frozen=True, kw_only=True)
class Reconstruct(ReconstructionOptions, _Output):
    """Reconstruct a capture as Gaussian splats.

    The depth maps give the points to start from, the images of the training views give everything else; every
    eighth view is held out and tells how good the result is.
    """

    captures: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="CAPTURE")]
    """A folder that 'digs-warp simulate' wrote, or your own recording (docs/formats.md). Of
    several, or of all in a folder of many scenes, each gets a folder in --out."""

    seed: Annotated[int, SEED] = 0
    """Decides everything random: matching of images, order of the views, backgrounds."""

    on: Annotated[EngineConfig, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="engine")] = field(
        default_factory=EngineConfig
    )

    can_resume: ClassVar[bool] = True
    recorded_as: ClassVar[str] = "reconstruct"
    recorded: ClassVar[type] = ReconstructionOptions
    main_flags: ClassVar[tuple[str, ...]] = (
        *("captures", *OUTPUT_FLAGS, "poses", "masks", "subject", "strategy", "voxel_size"),
        *("iterations", "time_budget", "device"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.captures:
            raise DigsError("CAPTURE: none given, expected the folder of a recording")

    @property
    def _is_of_many(self) -> bool:
        return len(self.captures) > 1 or any(is_data_set(each) for each in self.captures)

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Return the command with the settings of a run.json; required flags are `tyro.MISSING`."""
        options = from_json(ReconstructionOptions, settings, "settings", strict=True)
        return cls(
            captures=tyro.MISSING, output=ANY_FOLDER, seed=options.train.seed, **vars(options)
        )

    def execute(self) -> str:
        """Reconstruct and say how well it went."""
        if self._is_of_many:
            return self._reconstruct_many()
        if self.on != EngineConfig():
            raise DigsError(
                "--engine, --workers and --case-... are for several captures; name more, or a folder "
                "of many scenes"
            )
        return self._reconstruct_one()

    def _reconstruct_one(self) -> str:
        from digs_warp.data.capture import read_capture

        start = time.perf_counter()
        (source,) = self.captures
        capture = read_capture(source)
        result = self._reconstruct(capture, source)
        seconds = time.perf_counter() - start
        words = reconstruction_words(result, len(capture))
        out = self.output.out
        return (
            f"{out / layout.GAUSSIANS}: {words}, {seconds:.1f} s\n{result.verdict.words}\n"
            f"next: digs-warp report {out}, or look around: digs-warp view {out}"
        )

    def _reconstruct(self, capture: "Capture", source: Path) -> "Reconstruction":
        from digs_warp.pipeline.reconstruct import check_machine, reconstruct

        config = self.reconstruct_config(self.seed, capture)
        check_machine(config)  # a wrong flag is named first
        with self.output.opened([source]) as folder:
            compile_kernels()
            return reconstruct(capture, config, folder, self.output.resume)

    def _reconstruct_many(self) -> str:
        from digs_warp.engines.task import RESULTS
        from digs_warp.pipeline.reconstruct import check_machine

        jobs = find_jobs(self.captures)
        options = self._options()
        if self.on.address is None:
            check_machine(options.reconstruct_config(self.seed))  # a wrong flag is named first
        log = RunLog("reconstruct", options)

        def make(folder: Path) -> dict[str, str | DigsError]:
            lines = reconstruct_many(jobs, options, self.seed, folder, self.on)
            return {
                line["name"]: line.get("words") or DigsError(f"failed: {line['error']}")
                for line in lines
            }

        inputs = [job.capture for job in jobs]
        return make_many(self.output, log, self.on, inputs, make, "capture", RESULTS)

    def _options(self) -> ReconstructionOptions:
        """Return the settings of all captures, without the flags of the command."""
        names = (each.name for each in fields(ReconstructionOptions))
        values: dict[str, Any] = {name: getattr(self, name) for name in names}
        values["train"] = replace(self.train, seed=self.seed)
        return ReconstructionOptions(**values)
