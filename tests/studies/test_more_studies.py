"""The studies beside those of the package: what their cases differ in."""

from typing import Any

import pytest

from digs_warp.data.capture import Capture
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.catalogue import Study, find_study
from digs_warp.study.engine.case import with_settings
from digs_warp.train.config import DEPTH_WEIGHT, TrainConfig
from reference.study_records import record_of
from studies import few_views
from studies.catalogue import MORE_STUDIES
from studies.components import camera


@pytest.mark.parametrize("study", MORE_STUDIES, ids=lambda study: study.name)
def test_cases_differ_are_accepted_and_reported(study: Study) -> None:
    cases = study.cases(2, 1, 300)
    assert len({case.key for case in cases}) == len(cases) > 10
    for case in cases:
        with_settings(SimulateConfig(), case.recording)
        with_settings(ReconstructConfig(), case.reconstruction)
    records = [record_of(case, number) for number, case in enumerate(cases)]
    tables = [table for section in study.sections(records) for table in section.tables]
    assert all(len(row) == len(table.headings) for table in tables for row in table.rows)
    assert sum(len(table.rows) for table in tables) > 20


def config_of(training: str) -> ReconstructConfig:
    cases = find_study("components", MORE_STUDIES).cases(2, 1, 300)
    case = next(case for case in cases if case.labels.get("training") == training)
    return with_settings(ReconstructConfig(), case.reconstruction)


def test_nothing_is_all_parts_off_and_everything_is_the_defaults() -> None:
    nothing, everything = config_of(camera.NOTHING), config_of(camera.EVERYTHING)
    train = nothing.train
    assert (train.fit_exposure, train.rolling_shutter, train.motion_blur) == ("off",) * 3
    assert (train.clean_rim, nothing.sfm.refine_poses, train.sh_degree) == ("off", "off", 1)
    assert train.resolved_depth_weight(is_measured=True) == 0.0
    assert everything.train == TrainConfig(stop=everything.train.stop)
    assert everything.sfm.refine_poses == "auto"


def test_a_case_trains_on_as_many_views_as_it_says() -> None:
    for case in few_views.cases({"mug": {}}):
        recording = with_settings(SimulateConfig(), case.recording)
        config = with_settings(ReconstructConfig(), case.reconstruction)
        frames: Any = list(range(recording.frame_count))
        training, held_out = Capture(None, frames, None).split(config.test_every)  # pyright: ignore
        assert len(training) == len(held_out) == case.labels["views"]
        weight = config.train.resolved_depth_weight(is_measured=True)
        assert weight == (DEPTH_WEIGHT if case.labels["depth loss"] == "on" else 0.0)
        assert config.needs_sfm == (case.labels["strategy"] == "default")
