"""`digs-warp study plan`: what thousands of scenes would take."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from digs_warp.commands.command import Command
from digs_warp.commands.facts import format_facts
from digs_warp.settings import FRAMES, ITERATIONS, SIDE, SPLATS, WEIGHT, Range


@dataclass(frozen=True, kw_only=True)
class PlanScenes(Command):
    """Say what many scenes would take: hours, memory, storage and cost.

    Time and memory come from the laws of 'digs-warp study run scaling'; for the storage, a few frames are
    recorded and reconstructed now. One scene runs on one thread, as many at a time as there are cores.
    """

    scenes: Annotated[int, Range(1, 100_000)] = 10_000
    """Scenes to record and to reconstruct, with the poses of the recording."""

    frames: Annotated[int, FRAMES] = 40
    """Frames of each."""

    width: Annotated[int, SIDE] = 640
    """Image width [px]."""

    height: Annotated[int, SIDE] = 360
    """Image height [px]."""

    splats: Annotated[int, SPLATS] = 50_000
    """Gaussians of each reconstruction."""

    iterations: Annotated[int, ITERATIONS] = 1000
    """Training steps of each."""

    cores: Annotated[int, Range(1, 1_000_000)] = 64
    """Scenes at a time."""

    price: Annotated[float, WEIGHT]
    """Price of a core for an hour, in your currency."""

    study: Path | None = None
    """Folder of the scaling study. Default: out/study/scaling; without it, the published results, whose
    seconds are those of another machine."""

    def execute(self) -> str:
        """Return the plan."""
        from digs_warp.study.engine.store import Store
        from digs_warp.study.many_plan import predict, sample_storage
        from digs_warp.study.recommend.published import study_folder
        from digs_warp.study.studies.scaling import Load

        records = Store(study_folder("scaling", self.study)).finished()
        sizes = (self.frames, self.width, self.height, self.splats, self.iterations)
        load = Load("a scene", *sizes)
        one, stored = predict(records, load), sample_storage(load)
        record, reconstruct = (
            self.scenes * seconds / 3600 for seconds in (one.record, one.reconstruct)
        )
        total = record + reconstruct
        machines = " and ".join(sorted({each["machine"] for each in records}))
        errors = " and ".join(f"{100 * miss:.0f} %" for miss in one.misses.values())
        at_a_time = min(self.cores, self.scenes)
        memory = one.memory / 1e3
        recordings, results = (
            self.scenes * size / 1e9 for size in (stored.recording, stored.reconstruction)
        )
        return format_facts(
            {
                "scenes": f"{self.scenes:,} of {self.frames} frames of {self.width} x {self.height}, "
                f"{self.splats:,} Gaussians, {self.iterations:,} steps",
                "one scene": f"{one.record:.0f} s to record and {one.reconstruct:.0f} s to reconstruct, "
                "on one thread",
                "core hours": f"{record:,.0f} to record and {reconstruct:,.0f} to reconstruct: {total:,.0f}",
                "hours": f"{total / at_a_time:,.1f} with {at_a_time} scenes at a time",
                "memory": f"{memory:.1f} GB a scene, {at_a_time * memory:,.0f} GB at a time",
                "storage": f"{recordings:,.0f} GB of recordings and {results:,.0f} GB of reconstructions",
                "cost": f"{total * self.price:,.0f} at {self.price:g} a core hour",
                "measured": f"on {machines}; the laws miss its cases by {errors} (median)",
            }
        )
