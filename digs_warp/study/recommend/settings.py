"""The settings that the trade-off study measured, as one can give them to a capture that is there already."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from digs_warp.init.strategies import STRATEGIES
from digs_warp.study.engine.records import Record, Spread, final_psnr, group_by
from digs_warp.study.scenes import voxel_size
from digs_warp.study.studies.tradeoff import KNOBS, OF_SFM, RECORDING, USUAL, name_of

# Width of a pixel at the object in the recordings of the study [m], by `init.voxel_size.pixel_size`: 2.57 mm
# for the mustard bottle and 2.24 mm for the avocado.
STUDY_PIXEL = 0.0024
# Knobs of a reconstruction that are no choice here: poses are what the capture has, and the photographs say
# which degree of the color they need.
NO_CHOICE = ("poses", "SH degree", *OF_SFM)
# What a setting changes from the start that depth gives: no choice where there is none.
OF_DEPTH = ("voxel size [mm]", "initialization", "density control", "weight of depth")
# Stages whose time grows as the frames' pixels do.
PIXEL_STAGES = ("mask agreement", "load views", "prepare kernels", "measure course", "evaluate")


@dataclass(frozen=True)
class Setting:
    """A setting of the reconstruction and what it did in the study, averaged over its objects.

    Attributes:
        knob, value: what was turned.
        changes: dotted settings of the reconstruction, without seeds and voxels.
        steps: of the training.
        voxel_pixels: edge length of the voxels, in pixels at the object.
        points: at the start.
        train, initialize, rest: seconds of the stages.
        quality: PSNR on the object [dB].
    """

    knob: str
    value: Any
    changes: dict[str, Any]
    steps: int
    voxel_pixels: float
    points: float
    train: float
    initialize: float
    rest: float
    quality: Spread

    @property
    def name(self) -> str:
        """What was turned, in words."""
        return name_of((self.knob, self.value))


def measured_settings(records: Sequence[Record], has_depth: bool) -> list[Setting]:
    """Return the settings that a capture can have; nothing if the usual one was not measured.

    As in the study's own tables, each setting is compared with the usual one on the objects that both have:
    ratios of seconds, differences of PSNR.

    Args:
        records: of the trade-off study.
        has_depth: whether the capture has depth.
    """
    usual = {
        _subject(record): record
        for record in records
        if record["labels"].get("knob") == USUAL and _is_complete(record)
    }
    if not usual:
        return []
    groups = group_by(records, "knob", "value")
    choices = {key: group for key, group in groups.items() if _is_choice(key, has_depth)}
    found = [_setting(key, group, usual) for key, group in choices.items()]
    return [setting for setting in found if setting is not None]


def usual_of(settings: Sequence[Setting]) -> Setting:
    """Return the usual setting, which `measured_settings` always has."""
    return next(setting for setting in settings if setting.knob == USUAL)


def _is_choice(key: tuple[Any, ...], has_depth: bool) -> bool:
    knob, value = key
    if knob == USUAL:
        return True
    if knob not in KNOBS or KNOBS[knob][0] != "reconstruction" or knob in NO_CHOICE:
        return False
    if not has_depth and knob in OF_DEPTH:
        return False
    return knob != "initialization" or not STRATEGIES[value].needs_sfm


def _setting(
    key: tuple[Any, ...], group: Sequence[Record], usual: dict[Any, Record]
) -> Setting | None:
    pairs = [(r, usual[_subject(r)]) for r in group if _subject(r) in usual and _is_complete(r)]
    if not pairs:
        return None
    base = list(usual.values())
    level = fmean(_psnr(record) for record in base)
    quality = Spread.of(level + _psnr(own) - _psnr(other) for own, other in pairs)
    assert quality is not None
    record = pairs[0][0]
    changes = {
        name: value
        for name, value in record["reconstruction"].items()
        if name not in ("train.seed", "init.voxel_size")
    }

    def seconds(*stages: str) -> float:
        ratio = fmean(_seconds(own, stages) / _seconds(other, stages) for own, other in pairs)
        return ratio * fmean(_seconds(each, stages) for each in base)

    rest = fmean(sum(each["seconds"].get(stage, 0.0) for stage in PIXEL_STAGES) for each in base)
    return Setting(
        knob=key[0],
        value=key[1],
        changes=changes,
        steps=record["reconstruction"]["train.stop.iterations"],
        voxel_pixels=_voxel(record) / STUDY_PIXEL,
        points=fmean(own["results"]["initial_points"] for own, _ in pairs),
        train=seconds("train"),
        initialize=seconds("initialize"),
        rest=rest,
        quality=quality,
    )


def _voxel(record: Record) -> float:
    """Return the edge length of the voxels of a case [m]."""
    found = record["results"].get("initialization", {}).get("voxel_size")
    strategy = record["reconstruction"].get("init.strategy", "highdepth")
    return found or record["reconstruction"].get("init.voxel_size") or voxel_size(strategy)


def _is_complete(record: Record) -> bool:
    seconds = record["seconds"]
    same_size = all(
        record["recording"].get(name, value) == value for name, value in RECORDING.items()
    )
    measured = seconds.get("train") and seconds.get("initialize")
    return bool(same_size and measured and final_psnr(record) is not None)


def _psnr(record: Record) -> float:
    value = final_psnr(record)
    assert value is not None
    return value


def _seconds(record: Record, stages: Sequence[str]) -> float:
    return sum(record["seconds"][stage] for stage in stages)


def _subject(record: Record) -> tuple[Any, Any]:
    return record["labels"].get("object"), record["labels"].get("seed")
