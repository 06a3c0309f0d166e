"""`digs-warp run`: from a mesh to a USD scene, all stages in one go."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import tyro

from digs_warp.commands.command import SettingsCommand
from digs_warp.commands.output import ANY_FOLDER, OUTPUT_FLAGS, OutputFolder
from digs_warp.commands.precompile import compile_kernels
from digs_warp.commands.reconstruction_options import ReconstructionOptions, reconstruction_words
from digs_warp.commands.simulate import RECORDING_FLAGS
from digs_warp.record import layout
from digs_warp.record.run_log import RunLog
from digs_warp.record.typed import from_json, to_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.words import format_facts

if TYPE_CHECKING:
    from digs_warp.pipeline.reconstruct import ReconstructConfig


@dataclass(frozen=True, kw_only=True)
class _Settings:
    """The settings in a run.json."""

    recording: SimulateConfig = field(default_factory=SimulateConfig)
    reconstruction: ReconstructionOptions = field(default_factory=ReconstructionOptions)


@dataclass(frozen=True, kw_only=True)
class _Recording(SettingsCommand):
    """What the help shows first: where the results go, and what is recorded."""

    output: Annotated[OutputFolder, tyro.conf.OmitArgPrefixes]
    recording: Annotated[SimulateConfig, tyro.conf.OmitArgPrefixes] = field(
        default_factory=SimulateConfig
    )


@dataclass(frozen=True, kw_only=True)
class Run(ReconstructionOptions, _Recording):
    """Do everything: record an object, reconstruct it, write the USD scene and a report.

    Without --mesh and --environment it takes the built-in object in the built-in room.
    """

    can_resume: ClassVar[bool] = True
    recorded_as: ClassVar[str] = "run"
    recorded: ClassVar[type] = _Settings
    main_flags: ClassVar[tuple[str, ...]] = (
        *OUTPUT_FLAGS,
        *RECORDING_FLAGS,
        *("iterations", "time_budget"),
    )

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Return the command with the settings of a run.json; required flags are `tyro.MISSING`."""
        record = from_json(cls.recorded, settings, "settings", strict=True)
        return cls(output=ANY_FOLDER, recording=record.recording, **vars(record.reconstruction))

    def execute(self) -> str:
        """Run the stages; run.json holds the times of those that are done."""
        from digs_warp.masks.masks import check_source
        from digs_warp.pipeline.reconstruct import check_machine

        config = self.reconstruct_config(self.recording.seed)
        check_machine(config)  # now, not after the recording
        check_source(config.segment)
        log = RunLog("run", {"recording": self.recording, "reconstruction": config})
        with self.output.opened(self.recording.input_files) as folder:
            what, verdict = self._run_stages(folder, config, log)
        return _summary(self.output.out, log, what, verdict)

    def _run_stages(
        self, folder: Path, config: "ReconstructConfig", log: RunLog
    ) -> tuple[str, str]:
        """Write everything into ``folder``; return the result in a phrase, and the verdict."""
        from digs_warp.pipeline.reconstruct import reconstruct
        from digs_warp.pipeline.scene_files import write_scene_file
        from digs_warp.pipeline.usd_scene import write_capture_package
        from digs_warp.show.report.page import write_report
        from digs_warp.sim.record.record import simulate

        record = folder / layout.RUN_RECORD
        reconstruction = folder / layout.RECONSTRUCTION
        compile_kernels()
        if self.output.resume:
            log.continue_from(record)
        log.save(record)
        with log.saved(record), log.stage("simulate"):
            capture = simulate(self.recording, folder / layout.CAPTURE, self.output.resume)
        with log.saved(record), log.stage("reconstruct"):
            result = reconstruct(capture, config, reconstruction, self.output.resume)
        other_sizes = result.scores.other_sizes
        log.results = {
            "gaussians": len(result.gaussians),
            "held_out": result.scores.mean.to_json(),
            "other_sizes": other_sizes and to_json(other_sizes),
            "verdict": to_json(result.verdict),
        }
        with log.saved(record), log.stage("export"):
            scene = folder / layout.SCENE
            write_capture_package(capture, result, scene)
            write_scene_file(folder / layout.SPLATS, result, reconstruction)
        with log.saved(record), log.stage("report"):
            write_report(capture, result, folder / layout.REPORT)
        return reconstruction_words(result, len(capture)), result.verdict.words


def _summary(folder: Path, log: RunLog, what: str, verdict: str) -> str:
    from digs_warp.show.report.capture_facts import recorded_object

    places = {
        "capture": layout.CAPTURE,
        "reconstruction": layout.RECONSTRUCTION,
        "scene": layout.SCENE,
        "splats": layout.SPLATS,
        "report": layout.REPORT,
    }
    facts = {name: str(folder / place) for name, place in places.items()}
    facts["object"] = recorded_object(folder / layout.CAPTURE) or "unknown"
    facts["seconds"] = ", ".join(f"{name} {value:.1f}" for name, value in log.seconds.items())
    facts["done"] = f"{what}, {sum(log.seconds.values()):.0f} s"
    facts["verdict"] = verdict
    facts["next"] = (
        f"open {folder / layout.REPORT} in a browser, or look around: digs-warp view {folder}"
    )
    return format_facts(facts)
