"""A resumed reconstruction makes what is missing again, with the same result."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from digs_warp.data.capture import Capture
from digs_warp.init.config import InitConfig
from digs_warp.masks.config import SegmentConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.record.manifest import Manifest
from digs_warp.train.config import Stop, TrainConfig

CONFIG = ReconstructConfig(
    init=InitConfig(voxel_size=0.02),
    segment=SegmentConfig(masks="depth"),
    train=TrainConfig(stop=Stop(iterations=12), sh_degree=0, evaluate_at=(6,), keep_course=True),
)


@pytest.fixture(scope="module")
def result(tiny_capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reconstruction")
    reconstruct(tiny_capture, CONFIG, folder)
    return folder


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
    tiny_capture: Capture,
    result: Path,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    pattern: str,
) -> None:
    folder = Path(shutil.copytree(result, tmp_path / "copy"))
    victim = sorted(folder.glob(pattern))[0]
    victim.unlink()
    reconstruct(tiny_capture, CONFIG, folder, resume=True)
    name = victim.relative_to(folder).as_posix()
    assert f"1 file is missing and made again: {name}" in caplog.text
    assert files(folder) == files(result)
    assert Manifest.read(folder).is_complete()
