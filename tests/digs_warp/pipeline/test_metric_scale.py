"""Whether lengths are in metres: unknown without depth, unless a distance was measured."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.checks import DigsError
from digs_warp.data.about import About
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.pipeline.poses import KnownDistance
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.files import read_json
from digs_warp.show.report.facts import describe
from digs_warp.show.report.run_section import figures_section
from reference.tiny_capture import write_tiny_capture

QUICK: dict[str, Any] = {"iterations": 5, "sh_degree": 0}
# The recording below is as large as if it had been measured in these units.
UNITS_PER_METRE = 7.0


def scaled(capture: Capture, factor: float) -> Capture:
    """Return a capture without depth whose poses are in another unit than the metre."""

    def moved(pose: np.ndarray) -> np.ndarray:
        pose = pose.copy()
        pose[:3, 3] *= factor
        return pose

    frames = (
        replace(
            frame.without_layer(Layer.DEPTH),
            camera=replace(frame.camera, world_from_cam=moved(frame.camera.world_from_cam)),
        )
        for frame in capture.frames
    )
    return replace(capture, frames=tuple(frames))


@pytest.fixture(scope="module")
def metric(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("tiny"))


@pytest.fixture(scope="module")
def photographs(metric: Capture) -> Capture:
    return scaled(metric, UNITS_PER_METRE)


def distance_of(capture: Capture, a: str, b: str) -> float:
    places = {frame.name: frame.camera.center_world for frame in capture.frames}
    return float(np.linalg.norm(places[a] - places[b]))


def test_an_unknown_scale_is_said_everywhere(photographs: Capture, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = dw.reconstruct(photographs, out, **QUICK)
    assert result.poses.metric_scale is not None and not result.poses.metric_scale.known
    assert (
        read_json(out / "run.json", "record")["results"]["poses"]["metric_scale"]["known"] is False
    )
    facts = describe(out)
    assert facts["scale"].startswith("unknown: the recording has no depth")
    assert facts["extent"].endswith(" units")
    loaded = Reconstruction.load(out)
    assert loaded.poses.metric_scale == result.poses.metric_scale
    assert "unknown: the recording has no depth" in figures_section(loaded)
    loaded.save_usd(tmp_path / "scene.usda")
    assert "scale unknown" in describe(tmp_path / "scene.usda")["axes and unit"]


def test_a_measured_distance_gives_the_scale(
    metric: Capture, photographs: Capture, tmp_path: Path
) -> None:
    truth = distance_of(metric, "0000", "0008")
    text = f"0000,0008={100 * truth:.6f}cm"
    result = dw.reconstruct(photographs, tmp_path, scale_from=text, **QUICK)
    assert result.poses.metric_scale is not None and result.poses.metric_scale.known
    assert result.frames is not None and result.start is not None
    assert result.frames.sfm_per_metre == pytest.approx(UNITS_PER_METRE, rel=1e-6)
    true = {frame.name: frame.camera for frame in metric.frames}
    for frame in (*result.frames.training, *result.frames.held_out):
        np.testing.assert_allclose(
            frame.camera.world_from_cam, true[frame.name].world_from_cam, atol=1e-6
        )
    # The ball has a radius of 0.2 m.
    assert np.median(np.linalg.norm(result.start.points.points_world, axis=1)) == pytest.approx(
        0.2, abs=0.04
    )
    assert describe(tmp_path)["scale"] == f"metres, by the distance {text} (--scale-from)"


def test_depth_gives_the_scale(metric: Capture) -> None:
    assert str(metric.metric_scale) == "metres, by the depth maps"
    with pytest.raises(DigsError, match="depth maps, which tell the scale; leave it out"):
        dw.reconstruct(metric, scale_from="0000,0008=1m", **QUICK)


def test_poses_can_be_known_to_be_in_metres(photographs: Capture) -> None:
    told = replace(photographs, about=About(recorded_as="tum", poses_in_metres=True))
    assert str(told.metric_scale) == "metres, by the poses of the recording"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0000,0008=0.30m", 0.3),
        ("0000, 0008 = 30 cm", 0.3),
        ("0000,0008=300mm", 0.3),
        ("0000,0008=3e-1m", 0.3),
    ],
)
def test_distances_are_read_in_metres_and_smaller(text: str, expected: float) -> None:
    found = KnownDistance.parse(text)
    assert (found.first, found.second) == ("0000", "0008")
    assert found.metres == pytest.approx(expected)


@pytest.mark.parametrize(
    "text", ["", "0.3m", "0000,0008", "0000,0008=", "0000,0008=0.3", "0000,0008=x m", "a,b=1ft"]
)
def test_other_texts_are_refused_with_the_form(text: str) -> None:
    with pytest.raises(DigsError, match=r"such as 0000,0031=0\.30m"):
        KnownDistance.parse(text)


@pytest.mark.parametrize("text", ["a,b=0m", "a,a=1m", "a,b=1.2.3m", "a,b=1e-999m"])
def test_impossible_distances_are_refused(text: str) -> None:
    with pytest.raises(DigsError, match="two different frames and a distance above 0"):
        KnownDistance.parse(text)


def test_an_unknown_frame_is_named(photographs: Capture) -> None:
    with pytest.raises(DigsError, match="no frame '0099'"):
        dw.reconstruct(photographs, scale_from="0000,0099=1m", **QUICK)


def test_cameras_in_one_place_tell_no_scale(photographs: Capture) -> None:
    first = photographs.frames[0]
    again = replace(first, name="again", time=99.0)
    both = replace(photographs, frames=(*photographs.frames, again))
    with pytest.raises(DigsError, match="in one place"):
        dw.reconstruct(both, scale_from="0000,again=1m", **QUICK)
