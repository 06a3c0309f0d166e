"""Camera profiles against published figures, and custom ones from YAML."""

from dataclasses import replace
from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.camera.profiles import IMAGE_FIGURES, PROFILES, RIG_FIGURES, load_profile


@pytest.mark.parametrize(
    ("name", "depth", "disparity", "tolerance"),
    [
        ("zed2-2k", 1.0, 127.7, 0.05),
        ("zed2-2k", 5.0, 25.5, 0.05),
        ("zed2-720", 0.5, 127.7, 0.05),
        ("zed2-720", 3.0, 21.3, 0.05),
        ("d435", 0.168, 126.0, 0.5),
        ("d455", 0.32, 126.0, 0.5),
        ("gemini-335", 0.1637, 126.0, 0.5),
        ("oak-d", 0.7, 95.0, 0.5),
    ],
)
def test_disparities_are_the_published_ones(
    name: str, depth: float, disparity: float, tolerance: float
) -> None:
    rig = load_profile(name).rig()
    assert rig.focal_baseline / depth == pytest.approx(disparity, abs=tolerance)


@pytest.mark.parametrize("name", PROFILES)
def test_every_figure_has_an_origin_and_a_note(name: str) -> None:
    profile = load_profile(name)
    assert profile.name == name
    assert set(profile.figures) == set(IMAGE_FIGURES) | set(RIG_FIGURES)
    for figure in profile.figures.values():
        assert figure.origin in ("measured", "vendor", "tuned") and figure.note


def test_resized_rigs_see_the_same_angle() -> None:
    full, small = (load_profile("zed2-2k").rig(*size) for size in ((2208, 1242), (552, None)))
    assert (small.intrinsics.width, small.intrinsics.height) == (552, 310)
    assert small.intrinsics.fx == pytest.approx(full.intrinsics.fx / 4)
    assert small.baseline == full.baseline


CUSTOM = """
title: stereo head of the lab
base: d435
figures:
  baseline: {value: 0.2, origin: measured, note: calibration of 3 May}
  window: {value: 9, origin: tuned}
"""


def custom(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "head.yaml"
    path.write_text(content, encoding="utf-8")
    return path


def test_a_custom_profile_changes_its_base(tmp_path: Path) -> None:
    profile = load_profile(custom(tmp_path, CUSTOM))
    assert (profile.name, profile.title) == ("head", "stereo head of the lab")
    assert profile.figures["baseline"].origin == "measured"
    rig = profile.rig()
    assert (rig.baseline, rig.window) == (0.2, 9)
    assert rig.disparity_step == load_profile("d435").rig().disparity_step


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("figures: {baseline: {value: '2e-05', origin: tuned}}", "expected {value: number"),
        ("- a list", "expected a mapping, found list"),
        ("figures: [1]", "expected a mapping with 'figures'"),
        ("figures: {: :", "not readable as YAML"),
        ("base: kinect\nfigures: {}", "base 'kinect', expected one of zed2-2k"),
        ("figures: {sharpness: {value: 1, origin: tuned}}", r"unknown figures \['sharpness'\]"),
        ("figures: {baseline: 0.2}", "found 0.2, expected {value: number"),
        ("base: [zed2-2k]\nfigures: {}", "base .*, expected one of zed2-2k"),
        ("figures: {" * 3000, "not readable as YAML"),
        ("figures: {baseline: {value: 0.2, origin: guessed}}", "origin 'guessed', expected one of"),
    ],
)
def test_bad_profiles_are_refused(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(DigsError, match=message):
        load_profile(custom(tmp_path, content))


def test_an_unknown_profile_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="profile 'kinect': not known; expected one of zed2-2k"):
        load_profile("kinect")
    with pytest.raises(DigsError, match="no such file"):
        load_profile(tmp_path / "missing.yaml")


@pytest.mark.parametrize(
    "changes",
    [
        *({"window": 4}, {"vignetting": 1.5}, {"static_field": -0.1}, {"unit": -1}),
        *({"full_well": 0.0}, {"rotation_drift": float("nan")}),
    ],
)
def test_impossible_figures_are_refused(changes: dict[str, float]) -> None:
    with pytest.raises(DigsError, match=f"rig: {next(iter(changes))}"):
        replace(load_profile("bare-matcher").rig(64, 48), **changes)
