"""Settings for a capture and a time: laws on published figures, the choice, and what the look sees."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.study.recommend.choose import Studies, reasons, recommend
from digs_warp.study.recommend.look import Look, look_at, scatter
from digs_warp.study.recommend.published import read_studies
from digs_warp.study.recommend.settings import Setting, measured_settings, usual_of
from digs_warp.study.recommend.times import Times, times
from digs_warp.study.studies.scaling import ONE_THREAD, load_of
from reference.recorded import small_capture

# The laws of one study predict the cases of the other within this factor.
FACTOR = 1.5


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("without_own_studies"))
        return read_studies()


@pytest.fixture(scope="module")
def settings(studies: Studies) -> list[Setting]:
    return measured_settings(studies.tradeoff, has_depth=True)


@pytest.fixture(scope="module")
def like_study(settings: list[Setting]) -> Look:
    """The look of a recording as those of the study are."""
    points = round(usual_of(settings).points)
    return Look(40, 480, 270, "object", True, True, True, looked_at=35, points=points)


@pytest.fixture
def capture(tmp_path: Path) -> Capture:
    return small_capture(tmp_path / "small")


def times_of(look: Look, settings: list[Setting], studies: Studies, machine: float | None) -> Times:
    training = look.frames * 7 // 8
    return times(look, settings, studies.tradeoff, studies.scaling, training, machine, False)


def test_what_the_study_measured_is_predicted(
    studies: Studies, settings: list[Setting], like_study: Look
) -> None:
    found = times_of(like_study, settings, studies, 1.0)
    for setting in settings:
        measured = setting.train + setting.initialize + setting.rest
        assert found.seconds(setting) == pytest.approx(measured, rel=1e-3)
        assert found.points(setting) == pytest.approx(setting.points, rel=1e-3)


def test_cases_of_the_other_study_are_predicted(studies: Studies, settings: list[Setting]) -> None:
    """Other images, frames and points: 16 to 128 frames, 320 to 1280 wide, 7,000 to 230,000 points.

    The studies were measured at different times: one factor between them is that of the machine.
    """
    usual = usual_of(settings)
    stages = ("train", "initialize", "load views", "measure course", "evaluate")
    cases = [r for r in studies.scaling if r["labels"]["curve"] != ONE_THREAD]
    assert len(cases) == 10
    ratios = []
    for record in cases:
        load = load_of(record)
        points = record["results"]["initial_points"]
        look = Look(
            *(load.frames, load.width, load.height, "object", True, True, True),
            looked_at=load.frames * 7 // 8,
            points=points,
        )
        shorter = replace(usual, steps=load.steps, train=usual.train * load.steps / usual.steps)
        predicted = times_of(look, settings, studies, 1.0).seconds(shorter)
        ratios.append(sum(record["seconds"][stage] for stage in stages) / predicted)
    machine = np.median(ratios)
    assert 1 / FACTOR < min(ratios) / machine and max(ratios) / machine < FACTOR


@pytest.mark.parametrize(
    "more",
    [{"frames": 80}, {"width": 960}, {"points": 150_000}, {"frames": 80, "points": 150_000}],
    ids=str,
)
def test_more_work_takes_longer(
    more: dict[str, int], studies: Studies, settings: list[Setting], like_study: Look
) -> None:
    less = times_of(like_study, settings, studies, 1.0)
    longer = times_of(replace(like_study, **more), settings, studies, 1.0)
    for setting in settings:
        assert longer.seconds(setting) > less.seconds(setting)
    of_a_slow_machine = times_of(like_study, settings, studies, 3.0)
    assert of_a_slow_machine.seconds(settings[0]) == pytest.approx(3 * less.seconds(settings[0]))


def test_the_check_takes_its_time_whatever_is_chosen(
    studies: Studies, settings: list[Setting], like_study: Look
) -> None:
    checked = replace(like_study, check_seconds=1.25)
    for setting in settings:
        usual, longer = (
            times_of(look, settings, studies, 2.0).seconds(setting)
            for look in (like_study, checked)
        )
        assert longer == pytest.approx(usual + 1.25)


def test_matching_images_takes_its_time(
    studies: Studies, settings: list[Setting], like_study: Look
) -> None:
    given = times(like_study, settings, studies.tradeoff, studies.scaling, 35, 1.0, matches=False)
    estimated = replace(given, matches=True)
    # 14 to 17 s in the studies, of 32 and 40 frames
    assert 8 < estimated.seconds(settings[0]) - given.seconds(settings[0]) < 40


def test_a_step_tells_how_fast_the_machine_is(
    studies: Studies, settings: list[Setting], like_study: Look
) -> None:
    usual = usual_of(settings)
    step = usual.train / usual.steps
    for factor in (0.5, 1.0, 4.0):
        look = replace(like_study, step_seconds=factor * step, step_points=like_study.points)
        assert times_of(look, settings, studies, None).machine == pytest.approx(factor, rel=1e-3)
    assert times_of(like_study, settings, studies, None).machine == 1.0


def test_only_what_a_capture_can_have_is_a_choice(studies: Studies) -> None:
    with_depth = {s.name for s in measured_settings(studies.tradeoff, has_depth=True)}
    assert {"usual", "iterations 1000", "voxel size 8", "initialization depth"} <= with_depth
    for not_now in ("frames", "image", "sensor", "samples", "poses", "fusion", "random", "SH"):
        assert not any(not_now in name for name in with_depth)
    without = {s.name for s in measured_settings(studies.tradeoff, has_depth=False)}
    assert without == {"usual", *(f"iterations {n}" for n in (100, 250, 1000, 2000))}


def test_the_best_that_fits_is_chosen(capture: Capture, studies: Studies) -> None:
    config = ReconstructConfig(test_every=4)
    found = recommend(capture, 1e6, config, studies, machine=1.0)
    seconds = [choice.seconds for choice in found.front]
    qualities = [choice.quality for choice in found.front]
    assert seconds == sorted(seconds) and qualities == sorted(qualities)
    assert len(seconds) > 2
    assert found.best == found.front[-1]
    for choice in found.front:
        exact = recommend(capture, choice.seconds, config, studies, machine=1.0)
        assert exact.best.setting == choice.setting
        named = re.findall(r"(\d+) gave", reasons(exact)["iterations"])
        assert len(set(named)) == len(named)  # not what other knobs gave with as many steps
    assert found.look.color is not None
    assert f"degree {found.look.color.degree}" in reasons(found)["color"]
    least = found.front[0]
    with pytest.raises(DigsError, match=f"fastest, '{least.setting.name}', takes about") as error:
        recommend(capture, 0.9 * least.seconds, config, studies, machine=1.0)
    allowed = float(str(error.value).partition("takes about ")[2].split()[0])
    assert recommend(capture, allowed, config, studies, machine=1.0).best.setting == least.setting
    with pytest.raises(DigsError, match=r"takes about \d+(\.\d)? s; allow"):  # without an exponent
        recommend(capture, 1.0, config, studies, machine=1000.0)


def test_without_depth_there_are_no_voxels(capture: Capture, studies: Studies) -> None:
    from digs_warp.data.layers import Layer

    frames = tuple(frame.without_layer(Layer.DEPTH) for frame in capture.frames)
    found = recommend(
        replace(capture, frames=frames), 1e6, ReconstructConfig(), studies, machine=1.0
    )
    assert found.settings.keys() == {"train.stop.iterations"}
    assert "without depth" in reasons(found)["capture"]
    assert "without depth it is lower" in reasons(found)["quality"]


def test_the_look_takes_what_the_capture_has(capture: Capture) -> None:
    found = look_at(capture, ReconstructConfig(), 2.0)
    intrinsics = capture.frames[0].camera.intrinsics
    assert (found.frames, found.width) == (len(capture), intrinsics.width)
    assert found.subject == "object" and found.has_masks and found.has_depth
    assert found.points == found.step_points > 3
    assert found.step_seconds is not None and found.step_seconds > 0
    coarse = look_at(capture, ReconstructConfig(), 6.0, timed=False)
    assert coarse.points < found.points and coarse.step_seconds is None
    assert found.check_seconds > 0.0 == coarse.check_seconds
    scene = look_at(capture, ReconstructConfig(subject="scene"), 2.0, timed=False)
    assert scene.subject == "scene" and scene.points > found.points and scene.pixel is None


def test_a_scene_gets_a_number_of_points(capture: Capture, studies: Studies) -> None:
    found = recommend(capture, 1e6, ReconstructConfig(subject="scene"), studies, machine=1.0)
    assert found.settings["init.target_points"] == found.best.points
    assert "init.voxel_size" not in found.settings
    assert f"{found.best.points:,}, in voxels" in reasons(found)["points"]
    assert "with depth, which scatters by" in reasons(found)["capture"]


def test_the_scatter_of_the_depth_is_its_noise(capture: Capture) -> None:
    """Points on the depth maps themselves scatter by nothing; moved along the rays, by that much."""
    (frame,) = capture.frames[:1]
    depth = frame.load_depth()
    rows, columns = np.nonzero(np.isfinite(depth))
    px = np.stack([columns, rows], axis=1) + 0.5
    z = depth[rows, columns].astype(np.float64)
    assert scatter([frame], frame.camera.unproject(px, z)) == pytest.approx(0.0, abs=1e-6)
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 0.005, len(z))
    expected = float(np.median(np.abs(noise)))
    found = scatter([frame], frame.camera.unproject(px, z + noise))
    assert found == pytest.approx(expected, rel=0.05)
    assert scatter([], np.zeros((1, 3))) is None
