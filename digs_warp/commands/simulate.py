"""`digs-warp simulate`: mesh and environment -> a capture folder, or many of them -> a data set."""

import glob
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import SettingsCommand
from digs_warp.commands.many_captures import make_many
from digs_warp.commands.output import ANY_FOLDER, OUTPUT_FLAGS, OutputFolder
from digs_warp.commands.precompile import compile_kernels
from digs_warp.engines.config import EngineConfig
from digs_warp.record.layout import DATA_SET
from digs_warp.record.run_log import RunLog
from digs_warp.record.typed import from_json
from digs_warp.settings import Range, Settings
from digs_warp.sim.config import SimulateConfig
from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.sim.record.randomize.draws import SceneJob


# Flags of a recording that the help of `run` and `simulate` shows.
RECORDING_FLAGS = ("mesh", "environment", "profile", "frames", "tier")


@dataclass(frozen=True, kw_only=True)
class ManyScenes(Settings):
    """Record many scenes into one folder: every mesh in every environment, or scenes drawn at random."""

    meshes: str | None = None
    """Pattern for mesh files, in quotes, for example 'meshes/**/*.glb'."""

    environments: str | None = None
    """Pattern for environment files, in quotes, for example 'skies/*.hdr'."""

    trajectories: Annotated[int, Range(1, 10_000)] = 1
    """Camera paths per object and environment, each with its own seed."""

    scenes: Annotated[int | None, Range(1, 100_000)] = None
    """Number of scenes drawn at random: of --meshes and --environments one for each scene, the rest as
    --randomize says. Scene i depends on --seed and i alone."""

    randomize: str | None = None
    """What is drawn for --scenes, and from which distributions: indoor, tabletop, wild, or a YAML file
    (docs/simulate.md has all keys). A flag that differs from its default stays as given. Default:
    indoor."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.randomize is not None and self.scenes is None:
            raise DigsError(f"--randomize {self.randomize}: how many scenes? Give --scenes, too")
        if self.scenes is not None and self.trajectories != 1:
            raise DigsError(
                "--scenes and --trajectories contradict each other; give one of them. Every scene already "
                "has another camera path"
            )

    @property
    def asked_for(self) -> bool:
        """Whether any of the flags was given."""
        return self != ManyScenes()

    def find(self) -> tuple[list[Path], list[Path]]:
        """Return the mesh and environment files, sorted."""
        return _matches("meshes", self.meshes), _matches("environments", self.environments)


def _matches(flag: str, pattern: str | None) -> list[Path]:
    if pattern is None:
        return []
    paths = [Path(name) for name in sorted(glob.glob(pattern, recursive=True))]
    files = [path for path in paths if path.is_file()]
    if not files:
        raise DigsError(f"--{flag} '{pattern}': no file matches; put the pattern in quotes")
    return files


@dataclass(frozen=True, kw_only=True)
class _Settings:
    """The settings in the run.json of a folder of captures."""

    recording: SimulateConfig = field(default_factory=SimulateConfig)
    scenes: ManyScenes = field(default_factory=ManyScenes)


@dataclass(frozen=True, kw_only=True)
class Simulate(SettingsCommand):
    """Record an object with a simulated handheld stereo depth camera.

    Writes a capture folder: images, depth, masks and poses. nerfstudio reads it, too.
    With --meshes, --environments, --trajectories or --scenes it writes a folder of captures and a summary.
    """

    output: Annotated[OutputFolder, tyro.conf.OmitArgPrefixes]
    recording: Annotated[SimulateConfig, tyro.conf.OmitArgPrefixes] = field(
        default_factory=SimulateConfig
    )
    many: Annotated[ManyScenes, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="many scenes")] = (
        field(default_factory=ManyScenes)
    )
    on: Annotated[EngineConfig, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="engine")] = field(
        default_factory=EngineConfig
    )

    can_resume: ClassVar[bool] = True
    recorded_as: ClassVar[str] = "simulate"
    recorded: ClassVar[type] = SimulateConfig
    main_flags: ClassVar[tuple[str, ...]] = (
        *OUTPUT_FLAGS,
        *RECORDING_FLAGS,
        *("meshes", "scenes"),
    )

    def __post_init__(self) -> None:
        one_of_many = (("mesh", "meshes"), ("scene", "meshes"), ("environment", "environments"))
        for one, several in one_of_many:
            if getattr(self.recording, one) and getattr(self.many, several):
                raise DigsError(f"--{one} and --{several} contradict each other; give one of them")
        if self.on != EngineConfig() and not self.many.asked_for:
            raise DigsError(
                "--engine, --workers and --case-... are for many scenes; give --scenes, --meshes, "
                "--environments or --trajectories, too"
            )

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Return the command with the settings of a run.json; required flags are `tyro.MISSING`."""
        is_of_many = "recording" in settings  # else the record of one capture
        record = from_json(
            _Settings, settings if is_of_many else {"recording": settings}, "settings", strict=True
        )
        return cls(output=ANY_FOLDER, recording=record.recording, many=record.scenes)

    def execute(self) -> str:
        """Record and say what was recorded."""
        return self._record_many() if self.many.asked_for else self._record_one()

    def _record_one(self) -> str:
        from digs_warp.show.report.capture_facts import recorded_object
        from digs_warp.sim.record.record import simulate

        start = time.perf_counter()
        with self.output.opened(self.recording.input_files) as folder:
            compile_kernels()
            capture = simulate(self.recording, folder, resume=self.output.resume)
        k = capture.frames[0].camera.intrinsics
        seconds = time.perf_counter() - start
        return (
            f"{self.output.out}: {counted(len(capture), 'frame')} of {k.width} x {k.height} in "
            f"{seconds:.1f} s\n"
            f"object: {recorded_object(self.output.out)}\n"
            f"next: digs-warp view {self.output.out}, or digs-warp reconstruct {self.output.out} --out FOLDER"
        )

    def _record_many(self) -> str:
        from digs_warp.sim.record.data_set import simulate_many
        from digs_warp.sim.record.sensor_plan import check_effects

        check_effects(self.recording)
        meshes, environments = self.many.find()
        jobs = self._jobs(meshes, environments)
        log = RunLog("simulate", {"recording": self.recording, "scenes": self.many})

        def make(folder: Path) -> dict[str, str | DigsError]:
            results = simulate_many(jobs, folder, self.on)
            return {r.name: DigsError(str(r)) if r.error else str(r) for r in results}

        inputs = [*self.recording.input_files, *meshes, *environments]
        return make_many(self.output, log, self.on, inputs, make, "scene", DATA_SET)

    def _jobs(self, meshes: Sequence[Path], environments: Sequence[Path]) -> "tuple[SceneJob, ...]":
        from digs_warp.sim.record.data_set import plan_jobs
        from digs_warp.sim.record.randomize.draws import draw_scenes
        from digs_warp.sim.record.randomize.randomization import DEFAULT_BASE, load_randomization

        if self.many.scenes is None:
            return plan_jobs(self.recording, meshes, environments, self.many.trajectories)
        randomization = load_randomization(self.many.randomize or DEFAULT_BASE)
        return draw_scenes(randomization, self.recording, self.many.scenes, meshes, environments)
