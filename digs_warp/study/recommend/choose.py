"""Chooses the settings of a reconstruction by its capture and a time, and says why."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.study.engine.records import Record, pareto_front
from digs_warp.study.recommend.look import Look, look_at
from digs_warp.study.recommend.settings import Setting, measured_settings, usual_of
from digs_warp.study.recommend.times import Times, times
from digs_warp.study.studies.scaling import ONE_THREAD
from digs_warp.study.studies.tradeoff import USUAL
from digs_warp.words import counted

# The settings that differ in the number of steps alone.
STEP_KNOBS = ("iterations", USUAL)


@dataclass(frozen=True)
class Studies:
    """What was measured: records of the trade-off and of the scaling study, and where they are."""

    tradeoff: Sequence[Record]
    scaling: Sequence[Record]
    folder: Path

    @property
    def machines(self) -> str:
        """What the trade-off was measured on."""
        return " and ".join(sorted({record["machine"] for record in self.tradeoff}))


@dataclass(frozen=True)
class Choice:
    """A setting as it would be for this capture: its time [s], and its quality in the study [dB]."""

    setting: Setting
    seconds: float
    points: int
    voxel: float | None = None
    """Edge length of the voxels [m]; None: of a scene, or without depth."""
    is_targeted: bool = False
    """Whether voxels are made as large as the number of points needs: for scenes with depth."""

    @property
    def quality(self) -> float:
        """PSNR on the object in the study [dB]."""
        return self.setting.quality.mean

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted settings of the reconstruction."""
        changes = dict(self.setting.changes)
        if self.voxel is not None:
            changes["init.voxel_size"] = self.voxel
        if self.is_targeted:
            changes["init.target_points"] = self.points
        return changes


@dataclass(frozen=True)
class Recommendation:
    """What fits a capture and a time.

    Attributes:
        budget: the time [s].
        look: at the capture.
        times: the laws, for this capture and machine.
        best: the choice.
        front: all choices of which none is both faster and better, the fastest first.
        count: how many settings there were to choose from.
    """

    budget: float
    look: Look
    times: Times
    best: Choice
    front: tuple[Choice, ...]
    count: int

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted settings of the reconstruction."""
        return self.best.settings

    def to_json(self) -> dict[str, Any]:
        """Return what run.json says about it."""
        return {
            "budget": self.budget,
            "setting": self.best.setting.name,
            "settings": self.settings,
            "predicted_seconds": round(self.best.seconds, 2),
            "predicted_points": self.best.points,
            "study_psnr_object": round(self.best.quality, 3),
            "machine_factor": round(self.times.machine, 3),
        }


def recommend(
    capture: Capture,
    budget: float,
    config: ReconstructConfig,
    studies: Studies,
    machine: float | None = None,
) -> Recommendation:
    """Return the settings of the highest measured quality that fit a time.

    Args:
        capture: the recording.
        budget: time for the whole reconstruction [s].
        config: everything that is not chosen here.
        studies: what was measured.
        machine: how many times as long this machine takes as that of the study; None: it is measured.

    Raises:
        DigsError: nothing is as fast, or the studies lack what is needed.
    """
    settings = measured_settings(studies.tradeoff, capture.has_depth)
    if not settings or not _has_laws(studies.scaling):
        raise DigsError(
            f"recommend: '{studies.folder}' lacks the usual case of the trade-off study, or the scaling "
            "study has no case with structure from motion; measure them with 'digs-warp study run tradeoff' "
            "and 'digs-warp study run scaling'"
        )
    look = look_at(capture, config, usual_of(settings).voxel_pixels, timed=machine is None)
    training, _ = capture.split(config.test_every)
    laws = times(
        look,
        settings,
        studies.tradeoff,
        studies.scaling,
        len(training),
        machine,
        matches=config.sfm.poses == "sfm" or not look.knows_poses,
    )
    choices = [_choice(setting, laws) for setting in settings]
    front = tuple(choices[i] for i in pareto_front([(c.seconds, c.quality) for c in choices]))
    fitting = [choice for choice in front if choice.seconds <= budget]
    if not fitting:
        least = front[0]
        raise DigsError(
            f"{capture}: no setting takes {budget:g} s or less; the fastest, '{least.setting.name}', takes "
            f"about {_rounded_up(least.seconds)} s; allow that much, or record fewer or smaller images"
        )
    return Recommendation(budget, look, laws, fitting[-1], front, len(choices))


def reasons(found: Recommendation) -> dict[str, str]:
    """Say what was seen, what was chosen and why, a line each."""
    look, best = found.look, found.best
    lines = {"capture": _capture_words(look)}
    machine = "as stated or unmeasured" if look.step_seconds is None else "by the steps of a second"
    lines["machine"] = f"{found.times.machine:.2f} times the seconds of the study's, {machine}"
    lines["setting"] = (
        f"{best.setting.name}: the best of {counted(found.count, 'measured setting')} that fits "
        f"{found.budget:g} s"
    )
    lines["seconds"] = f"about {best.seconds:.1f}, by the laws of the scaling study"
    lines["quality"] = (
        f"{best.setting.quality.text(2)} dB on the object in the study"
        f"{'' if look.has_depth else ', from depth; without depth it is lower'}"
    )
    lines["iterations"] = f"{best.setting.steps}: {_steps_words(found)}"
    if best.is_targeted:
        lines["points"] = f"about {best.points:,}, in voxels that grow with the distance"
    if best.voxel is not None:
        lines["voxels"] = (
            f"{1e3 * best.voxel:.3g} mm, {best.setting.voxel_pixels:.1f} pixels at the object as in the "
            f"study: about {best.points:,} Gaussians"
        )
    if look.color is not None:
        lines["color"] = f"degree {look.color.degree}: {look.color.because}"
    better = [choice for choice in found.front if choice.quality > best.quality]
    if better:
        lines["next"] = (
            f"{better[0].setting.name} gave {better[0].quality - best.quality:+.2f} dB in the study, and "
            f"would take about {better[0].seconds:.0f} s"
        )
    else:
        lines["next"] = "nothing that was measured is better; more time would be left over"
    return lines


def _capture_words(look: Look) -> str:
    words = [f"{counted(look.frames, 'frame')} of {look.width} x {look.height}"]
    words.append("an object in masks" if look.subject == "object" else "a whole scene")
    words.append("with depth" if look.has_depth else "without depth")
    if look.scatter is not None:
        pixel = "" if look.pixel is None else f" (a pixel: {1e3 * look.pixel:.3g} mm)"
        words.append(f"which scatters by {1e3 * look.scatter:.3g} mm{pixel}")
    if not look.knows_poses:
        words.append("without poses")
    return ", ".join(words)


def _steps_words(found: Recommendation) -> str:
    """Say what other numbers of steps gave in the study, all else as usual."""
    best = found.best.setting
    settings = [choice.setting for choice in found.front]
    others = [s for s in settings if s.knob in STEP_KNOBS and s.steps != best.steps]
    if not others:
        return "no other number of steps was better for its time"
    words = [f"{s.steps} gave {s.quality.mean - best.quality.mean:+.2f} dB" for s in others]
    return "in the study, " + ", ".join(words)


def _choice(setting: Setting, laws: Times) -> Choice:
    pixel = laws.look.pixel
    voxel = None if pixel is None else float(f"{setting.voxel_pixels * pixel:.3g}")
    is_targeted = laws.look.has_depth and laws.look.subject == "scene"
    return Choice(setting, laws.seconds(setting), laws.points(setting), voxel, is_targeted)


def _has_laws(scaling: Sequence[Record]) -> bool:
    known = [record for record in scaling if record["labels"].get("curve") != ONE_THREAD]
    return any("structure from motion" in record["seconds"] for record in known)


def _rounded_up(seconds: float) -> str:
    """Return a time that is enough, also if the machine is measured again and a little slower."""
    return f"{math.ceil(10 * 1.05 * seconds) / 10:g}"
