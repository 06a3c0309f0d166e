"""Several captures in one command, and one in several formats with the poses that were refined."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.commands.many_captures import find_jobs
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.engines.task import RESULTS
from digs_warp.formats.captures.formats import read_recording
from digs_warp.record.layout import GAUSSIANS, INITIAL_POINTS
from digs_warp.record.run_log import RunLog
from reference.capture_scenes import splats
from reference.perturbed_poses import perturbed_poses
from reference.tiny_capture import write_tiny_capture

SHORT = ["--iterations", "10", "--sh-degree", "0", "--quiet"]


def assert_same_gaussians(one: Path, other: Path) -> None:
    first, second = (Gaussians.load(folder / "gaussians.npz") for folder in (one, other))
    for name, values in vars(first).items():
        np.testing.assert_array_equal(values, getattr(second, name))


@pytest.fixture
def captures(tmp_path: Path) -> Path:
    """Two captures, one of them empty at first sight, in a folder of many scenes."""
    folder = tmp_path / "set"
    write_tiny_capture(folder / "mug" / "00")
    shutil.copytree(folder / "mug" / "00", folder / "boot" / "00")
    (folder / "summary.json").write_text('{"scenes": []}')
    return folder


def test_each_capture_gets_what_it_gets_alone(captures: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"
    command = ["reconstruct", str(captures), "--out", str(out), *SHORT]
    assert main(command) == EXIT_OK
    assert "2 captures" in capsys.readouterr().out
    alone = tmp_path / "alone"
    assert main(["reconstruct", str(captures / "mug/00"), "--out", str(alone), *SHORT]) == EXIT_OK
    assert_same_gaussians(alone, out / "mug/00")
    lines = [json.loads(line) for line in (out / RESULTS).read_text().splitlines()]
    assert sorted(line["name"] for line in lines) == ["boot/00", "mug/00"]
    assert all(line["scores"]["psnr_object"] > 10 for line in lines)

    (out / "boot/00/gaussians.npz").unlink()
    kept = (out / "mug/00/gaussians.npz").stat().st_mtime_ns
    assert main([*command, "--resume"]) == EXIT_OK
    assert_same_gaussians(alone, out / "boot/00")
    assert (out / "mug/00/gaussians.npz").stat().st_mtime_ns == kept
    assert len((out / RESULTS).read_text().splitlines()) == 3
    assert main(["info", str(out)]) == EXIT_OK
    assert "2 captures" in capsys.readouterr().out


def test_a_capture_that_fails_does_not_stop_the_rest(
    captures: Path, tmp_path: Path, capsys
) -> None:
    (captures / "boot/00/transforms.json").write_text("{}")
    sources = [str(captures / name / "00") for name in ("boot", "mug")]
    assert main(["reconstruct", *sources, "--out", str(tmp_path / "out"), *SHORT]) == EXIT_BAD_INPUT
    assert "1 of 2 captures failed" in capsys.readouterr().err
    assert (tmp_path / "out/mug/00/gaussians.npz").is_file()


def test_names_are_what_the_paths_do_not_share(captures: Path, tmp_path: Path) -> None:
    write_tiny_capture(tmp_path / "other")
    names = [job.name for job in find_jobs([captures, tmp_path / "other"])]
    assert names == ["set/boot/00", "set/mug/00", "other"]


HELD_OUT = 4


def test_an_export_of_a_reconstruction_has_its_poses_and_masks(tmp_path: Path) -> None:
    """The last frame was not placed."""
    folder = tmp_path / "refined"
    capture = write_tiny_capture(folder / "capture", frames=9)
    recorded = [frame.camera.world_from_cam for frame in capture.frames]
    poses = perturbed_poses(recorded, 0.5, 0.005, seed=0)[:8]
    frames = [
        replace(
            frame.with_layer(Layer.MASK, np.full((54, 72), 255, np.uint8)),
            camera=replace(frame.camera, world_from_cam=pose),
        )
        for frame, pose in zip(capture.frames, poses, strict=False)
    ]
    held_out = frames[::HELD_OUT]
    training = [frame for i, frame in enumerate(frames) if i % HELD_OUT]
    result = folder / "reconstruction"
    PosedFrames(tuple(training), tuple(held_out)).save(result)
    splats(10).save(result / GAUSSIANS)
    PointCloud(np.zeros((10, 3)), np.zeros((10, 3))).save(result / INITIAL_POINTS)
    (result / "training.jsonl").write_text("")
    (result / "evaluation.json").write_text('{"mean": {}, "views": []}')
    RunLog("reconstruct", {}).save(result / "run.json")
    for form in ["nerfstudio", "colmap", "tum"]:
        out = tmp_path / form
        line = ["convert", str(folder / "reconstruction"), "--to", form, "--out", str(out)]
        assert main(line) == EXIT_OK
        frames = read_recording(out, form).frames
        found = [frame.world_from_cam for frame in frames if frame.world_from_cam is not None]
        assert_allclose(np.stack(found), np.stack(poses), atol=1e-5)
        for mask in out.glob("masks/*"):
            assert read_image(mask, "mask").min() == 255
    index = json.loads((tmp_path / "nerfstudio/transforms.json").read_text())
    assert index["val_filenames"] == ["images/0000.png", "images/0004.png"]
