"""The pipeline from a capture to Gaussians: what it leaves behind, resuming, and bad input."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.data.images import read_image, write_image
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.layers import Layer
from digs_warp.init.config import InitConfig
from digs_warp.masks.config import SegmentConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.records import find_capture
from digs_warp.record.files import read_json
from digs_warp.record.manifest import Manifest
from digs_warp.show.report.facts import describe
from digs_warp.show.report.run_section import figures_section
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import write_tiny_capture
from reference.trained_ball import assert_same_bits, interrupt

CONFIG = ReconstructConfig(
    init=InitConfig(voxel_size=0.012),
    train=TrainConfig(stop=Stop(iterations=60), sh_degree=0, evaluate_at=(30,)),
)


@pytest.fixture(scope="module")
def result(tiny_capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reconstruction")
    reconstruct(tiny_capture, CONFIG, folder)
    return folder


def test_held_out_views_get_better(result: Path) -> None:
    lines = [json.loads(line) for line in (result / "training.jsonl").read_text().splitlines()]
    measured = {line["iteration"]: line for line in lines if "psnr_frame" in line}
    assert list(measured) == [0, 30, 60]
    assert measured[60]["psnr_frame"] > measured[30]["psnr_frame"] > measured[0]["psnr_frame"] + 2
    assert measured[60]["psnr_frame"] > 19
    assert measured[60]["psnr_object"] < measured[60]["psnr_frame"]
    assert [line["iteration"] for line in lines] == list(range(0, 61, 10))
    seconds = [line["seconds"] for line in lines]
    assert seconds == sorted(seconds)


def test_the_folder_holds_what_the_documents_promise(result: Path, tiny_capture: Capture) -> None:
    evaluation = json.loads((result / "evaluation.json").read_text())
    names = [view["name"] for view in evaluation["views"]]
    assert names == [frame.name for frame in tiny_capture.split()[1]]
    mean = np.mean([view["psnr_frame"] for view in evaluation["views"]])
    assert evaluation["mean"]["psnr_frame"] == pytest.approx(mean)
    for name in names:
        assert read_image(result / "renders" / f"{name}.png").shape == (54, 72, 3)
    record = json.loads((result / "run.json").read_text())
    assert {"initialize", "train", "evaluate"} <= set(record["seconds"])
    assert record["results"]["training"]["gaussians"] == len(
        Gaussians.load(result / "gaussians.npz")
    )
    with np.load(result / "initial_points.npz") as points:
        radius = np.linalg.norm(points["points_world"], axis=1)
        np.testing.assert_allclose(radius, 0.2, atol=0.006)  # half a voxel
    assert not (result / "checkpoint.npz").exists()


def test_an_interrupted_run_resumes_to_the_same_bits(
    tiny_capture: Capture, result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt(lambda: reconstruct(tiny_capture, CONFIG, tmp_path), 37, monkeypatch)
    assert (tmp_path / "checkpoint.npz").exists()
    assert not (tmp_path / "gaussians.npz").exists()
    resumed = reconstruct(tiny_capture, CONFIG, tmp_path, resume=True)
    assert_same_bits(resumed.gaussians, Gaussians.load(result / "gaussians.npz"))
    lines = [json.loads(line) for line in (tmp_path / "training.jsonl").read_text().splitlines()]
    assert [line["iteration"] for line in lines] == list(range(0, 61, 10))


def test_held_out_views_do_not_serve_the_training(tiny_capture: Capture, tmp_path: Path) -> None:
    """Spoiling the held-out photographs changes the metrics, not the Gaussians."""
    spoiled = read_capture(shutil.copytree(tiny_capture.folder, tmp_path / "capture"))
    for frame in spoiled.split()[1]:
        write_image(frame.path(Layer.IMAGE), np.zeros((54, 72, 3), np.uint8))
        write_image(frame.path(Layer.DEPTH), np.full((54, 72), 0.5, np.float32))
    short = replace(CONFIG, train=replace(CONFIG.train, stop=Stop(iterations=5)))
    a = reconstruct(spoiled, short, tmp_path / "a").gaussians
    b = reconstruct(tiny_capture, short, tmp_path / "b").gaussians
    np.testing.assert_array_equal(a.means, b.means)
    np.testing.assert_array_equal(a.sh, b.sh)
    scores = [
        json.loads((tmp_path / name / "evaluation.json").read_text())["mean"]["psnr_frame"]
        for name in ("a", "b")
    ]
    assert scores[0] < scores[1]


SHORT = ReconstructConfig(
    init=InitConfig(voxel_size=0.02),
    segment=SegmentConfig(masks="depth"),
    train=TrainConfig(stop=Stop(iterations=12), sh_degree=0, evaluate_at=(6,), keep_course=True),
)


@pytest.fixture(scope="module")
def nine_views(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("run") / "capture", frames=9)


@pytest.fixture(scope="module")
def kept(nine_views: Capture) -> Reconstruction:
    return reconstruct(nine_views, SHORT, nine_views.folder.parent / "reconstruction")


def assert_same(one: Reconstruction, other: Reconstruction) -> None:
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(one.gaussians, name), getattr(other.gaussians, name))
    assert one.frames is not None and other.frames is not None
    for (a, a_held_out), (b, b_held_out) in zip(
        one.frames.by_time, other.frames.by_time, strict=True
    ):
        assert (a.name, a_held_out) == (b.name, b_held_out)
        np.testing.assert_array_equal(a.camera.world_from_cam, b.camera.world_from_cam)
        np.testing.assert_array_equal(a.load_mask(), b.load_mask())
    assert one.start is not None and other.start is not None
    np.testing.assert_array_equal(one.start.points.points_world, other.start.points.points_world)
    assert (one.start.sources, one.start.depth) == (other.start.sources, other.start.depth)
    # NaN does not equal itself, so compare as text.
    assert str(one.scores.views) == str(other.scores.views)
    assert str(one.course) == str(other.course)
    for name in ("capture", "settings", "seconds", "results", "figures"):
        assert getattr(one, name) == getattr(other, name), name
    assert len(one.load_snapshots()) == len(other.load_snapshots()) >= 2


def test_a_result_is_what_its_folder_holds(kept: Reconstruction) -> None:
    assert kept.folder is not None
    assert_same(Reconstruction.load(kept.folder), kept)
    assert (kept.strategy, kept.masks) == ("highdepth", "depth")
    assert kept.course[-1].score == kept.scores.mean
    assert kept.training.iterations == 12


def test_a_saved_copy_needs_nothing_of_the_first_folder(
    kept: Reconstruction, tmp_path: Path
) -> None:
    assert kept.folder is not None
    original = Path(shutil.copytree(kept.folder, tmp_path / "original"))
    copy = Reconstruction.load(original).save(tmp_path / "copy")
    shutil.rmtree(original)
    assert_same(copy, kept)
    assert_same(Reconstruction.load(tmp_path / "copy"), kept)
    name = kept.scores.views[0].name
    assert copy.load_render(name, (54, 72, 3)).any()


@pytest.mark.parametrize(
    "name", ["evaluation.json", "training.jsonl", "gaussians.npz", "run.json", "cameras.json"]
)
def test_broken_and_missing_files_are_named(
    nine_views: Capture, kept: Reconstruction, tmp_path: Path, name: str
) -> None:
    assert kept.folder is not None
    path = Path(shutil.copytree(kept.folder, tmp_path / "copy")) / name
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(DigsError, match=re.escape(name)):
        Reconstruction.load(path.parent, nine_views)
    path.unlink()
    if name != "cameras.json":  # older than the file: the recording's own poses
        with pytest.raises(DigsError, match=re.escape(name)):
            Reconstruction.load(path.parent, nine_views)
    if name not in ("gaussians.npz", "cameras.json"):
        assert len(Reconstruction.load(path.parent, partial=True).gaussians)


def files(folder: Path) -> dict[str, object]:
    """All files; of the records only what is the same in every run."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if name == "run.json":
            found[name] = without_times(json.loads(path.read_text())["results"])
        elif name == "training.jsonl":
            rows = map(json.loads, path.read_text().splitlines())
            found[name] = [without_times(row) for row in rows]
        elif path.is_file() and name != "files.jsonl":
            found[name] = path.read_bytes()
    return found


def without_times(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    return {key: without_times(each) for key, each in value.items() if "seconds" not in key}


@pytest.mark.parametrize(
    "pattern",
    [
        *("masks/*.png", "cameras.json", "initial_points.npz", "gaussians.npz", "training.jsonl"),
        *("course/*6.npz", "evaluation.json", "renders/*.png"),
    ],
)
def test_what_is_missing_is_made_again(
    nine_views: Capture,
    kept: Reconstruction,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    pattern: str,
) -> None:
    assert kept.folder is not None
    folder = Path(shutil.copytree(kept.folder, tmp_path / "copy"))
    victim = sorted(folder.glob(pattern))[0]
    victim.unlink()
    reconstruct(nine_views, SHORT, folder, resume=True)
    name = victim.relative_to(folder).as_posix()
    assert f"1 file is missing and made again: {name}" in caplog.text
    assert files(folder) == files(kept.folder)
    assert Manifest.read(folder).is_complete()


USUAL = TrainConfig(stop=Stop(iterations=20))


def exposed(tiny_capture: Capture, folder: Path, train: TrainConfig = USUAL) -> Reconstruction:
    return reconstruct(tiny_capture, ReconstructConfig(train=train), folder)


def test_constant_exposure_is_not_fitted(tiny_capture: Capture, tmp_path: Path) -> None:
    fitted = exposed(tiny_capture, tmp_path / "on")
    assert fitted.training.exposure_stops == 0.0
    without = exposed(tiny_capture, tmp_path / "off", replace(USUAL, fit_exposure="off"))
    assert without.training.exposure_stops is None
    np.testing.assert_array_equal(fitted.gaussians.sh, without.gaussians.sh)


def test_exposures_are_fitted_where_they_vary(tiny_capture: Capture, tmp_path: Path) -> None:
    frames = []
    for number, frame in enumerate(tiny_capture.frames):
        image = np.rint(frame.load_image() * (0.7 + 0.3 * np.cos(0.5 * number)))
        frames.append(frame.with_layer(Layer.IMAGE, image.astype(np.uint8)))
    uneven = exposed(replace(tiny_capture, frames=tuple(frames)), tmp_path / "uneven")
    assert uneven.training.exposure_stops and uneven.training.exposure_stops > 0.3


def test_an_unknown_scale_is_said_everywhere(tiny_capture: Capture, tmp_path: Path) -> None:
    out = tmp_path / "out"
    frames = tuple(frame.without_layer(Layer.DEPTH) for frame in tiny_capture.frames)
    result = dw.reconstruct(replace(tiny_capture, frames=frames), out, iterations=5, sh_degree=0)
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


NOTED = Path("captures/mug")  # as it was given in the folder "project"


def with_index(folder: Path) -> Path:
    folder.mkdir(parents=True)
    (folder / INDEX_NAME).write_text("{}")
    return folder


@pytest.fixture
def result_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "project/results/mug"
    folder.mkdir(parents=True)
    return folder


def test_the_recording_is_found_from_another_folder(
    tmp_path: Path, result_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    capture = with_index(tmp_path / "project" / NOTED)
    monkeypatch.chdir(tmp_path)
    assert find_capture(result_folder, NOTED) == capture
    assert find_capture(Path("project/results/mug"), NOTED) == Path("project") / NOTED
    monkeypatch.chdir(result_folder)
    found = find_capture(Path(), NOTED)
    assert found is not None and found.samefile(capture)
