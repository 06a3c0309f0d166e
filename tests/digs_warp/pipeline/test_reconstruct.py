"""The pipeline from a capture to Gaussians: what it leaves behind, resuming, and bad input."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import read_image, write_image
from digs_warp.data.layers import Layer
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.train.config import Stop, TrainConfig
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


def copied(tiny_capture: Capture, folder: Path) -> Path:
    return Path(shutil.copytree(tiny_capture.folder, folder))


def test_held_out_views_get_better(result: Path) -> None:
    lines = [json.loads(line) for line in (result / "training.jsonl").read_text().splitlines()]
    measured = {line["iteration"]: line for line in lines if "psnr_frame" in line}
    assert list(measured) == [0, 30, 60]
    assert measured[60]["psnr_frame"] > measured[30]["psnr_frame"] > measured[0]["psnr_frame"] + 3
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
    spoiled = read_capture(copied(tiny_capture, tmp_path / "capture"))
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
