"""How long a setting takes for a capture on this machine, by the laws of the scaling study."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.study.engine.records import Record
from digs_warp.study.recommend.look import Look
from digs_warp.study.recommend.settings import Setting, usual_of
from digs_warp.study.studies.scaling import LAWS, ONE_THREAD, Law, Load, fit
from digs_warp.study.studies.tradeoff import RECORDING

# How the points from depth grow with the frames, as a power, where the study has no other frames.
USUAL_GROWTH = 1 / 3


@dataclass(frozen=True)
class Times:
    """Seconds of any setting for one capture.

    Attributes:
        look: at the capture.
        usual: the usual setting of the study.
        laws: of the stages that the scaling study measured.
        growth: how the points from depth grow with the frames, as a power.
        training: frames that train.
        machine: how many times as long this machine takes as that of the study.
        matches: whether the poses are estimated.
    """

    look: Look
    usual: Setting
    laws: dict[str, Law]
    growth: float
    training: int
    machine: float
    matches: bool

    def points(self, setting: Setting) -> int:
        """Return how many points the setting starts from.

        The points of the look are those of the study's usual voxels; other voxels change their number as
        they did in the study.
        """
        if not self.look.has_depth:
            return self.look.points
        more_frames = (self.training / self.look.looked_at) ** self.growth
        here = self.look.points * more_frames * setting.points / self.usual.points
        return max(1, round(here))

    def seconds(self, setting: Setting) -> float:
        """Return the time of the whole reconstruction [s], without compiling kernels."""
        here, there = self._here(setting), _in_study(setting, setting.points)
        time = setting.train * self._ratio("train", here, there)
        time += setting.initialize * self._ratio("initialize", here, there)
        pixels = "frame pixels"
        time += setting.rest * here.counts()[pixels] / there.counts()[pixels]
        if self.matches:
            time += self.laws["structure from motion"].at(here)
        # The check was measured here: it has no law.
        return self.machine * time + self.look.check_seconds

    def _here(self, setting: Setting) -> Load:
        look = self.look
        return Load(
            "here", look.frames, look.width, look.height, self.points(setting), setting.steps
        )

    def _ratio(self, stage: str, here: Load, there: Load) -> float:
        return self.laws[stage].at(here) / self.laws[stage].at(there)


def times(
    look: Look,
    settings: Sequence[Setting],
    tradeoff: Sequence[Record],
    scaling: Sequence[Record],
    training: int,
    machine: float | None,
    matches: bool,
) -> Times:
    """Return the times of a capture.

    Args:
        look: at the capture.
        settings: measured ones, with the usual one.
        tradeoff: records of that study.
        scaling: records of that study, some of them on all threads.
        training: frames that train.
        machine: how many times as long this machine takes as that of the study; None: as long as the steps
            of the look say, or once, where there are none.
        matches: whether the poses are estimated.
    """
    known = [record for record in scaling if record["labels"].get("curve") != ONE_THREAD]
    stages = ("train", "initialize", "structure from motion")
    laws = {stage: fit(known, stage, LAWS[stage]) for stage in stages}
    usual = usual_of(settings)
    if machine is None:
        machine = machine_factor(look, usual, laws["train"])
    return Times(look, usual, laws, growth_of_points(tradeoff), training, machine, matches)


def machine_factor(look: Look, usual: Setting, law: Law) -> float:
    """Return how many times as long this machine takes for a training step as that of the study.

    Args:
        look: with the time of a step; without one, the answer is 1.
        usual: the usual setting of the study.
        law: of the training.
    """
    if look.step_seconds is None:
        return 1.0
    here = Load("a step here", look.frames, look.width, look.height, look.step_points, 1)
    there = _in_study(usual, usual.points)
    return look.step_seconds / (usual.train * law.at(here) / law.at(there))


def growth_of_points(tradeoff: Sequence[Record]) -> float:
    """Return the power by which points from depth grow with the frames, fitted to the study's knob."""
    known = [
        (record["labels"]["value"], record["results"]["initial_points"])
        for record in tradeoff
        if record["labels"].get("knob") == "frames" and record["labels"].get("seed", 0) == 0
    ]
    if len({frames for frames, _ in known}) < 2:
        return USUAL_GROWTH
    frames, points = np.log(np.array(known, np.float64)).T
    return float(np.clip(np.polyfit(frames, points, 1)[0], 0.0, 1.0))


def _in_study(setting: Setting, points: float) -> Load:
    size = (RECORDING["frames"], RECORDING["width"], RECORDING["height"])
    return Load("in the study", *size, round(points), setting.steps)
