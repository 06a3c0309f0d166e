"""`digs-warp convert` on Gaussians: any format into any other, decided by what the source is."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, NO_FILTER, Gaussians
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.formats.splats.files import write_splat_file
from digs_warp.pipeline import scene_files
from digs_warp.record.run_log import RunLog
from digs_warp.usd.reader import read_scene
from reference.splat_files import random_gaussians, shapes
from reference.tiny_capture import ball, write_tiny_capture

DEGREE = 1


@pytest.fixture
def gaussians() -> Gaussians:
    """What every format holds: colors within 0..1, no view dependence."""
    g = random_gaussians(20, DEGREE)
    g.sh[:, 0] = g.sh[:, 0].clip(-1.5, 1.5)
    g.sh[:, 1:] = 0
    return g


def run(
    capsys: pytest.CaptureFixture[str], source: object, target: object, *flags: str
) -> tuple[int, str]:
    code = main(["convert", str(source), "--out", str(target), *flags])
    out, err = capsys.readouterr()
    return code, out + err


def test_any_pair(tmp_path: Path, gaussians: Gaussians, capsys) -> None:
    """The scene survives, to the precision of the coarsest format."""
    for source, target in list(pairwise([*scene_files.WRITABLE, scene_files.WRITABLE[0]])):
        first, second, third = (
            tmp_path / f"{name}" for name in ("start.npz", "a" + source, "b" + target)
        )
        gaussians.save(first)
        assert run(capsys, first, second)[0] == EXIT_OK
        code, text = run(capsys, second, third)
        assert code == EXIT_OK, text
        assert "20 Gaussians" in text
        read = scene_files.read_scene(third).gaussians
        nearest = np.linalg.norm(read.means[:, None] - gaussians.means, axis=2).argmin(axis=0)
        read = read.select(nearest)  # some formats sort
        np.testing.assert_allclose(read.means, gaussians.means, atol=2e-3)
        np.testing.assert_allclose(shapes(read), shapes(gaussians), atol=0.4)
        np.testing.assert_allclose(read.opacities, gaussians.opacities, atol=1.1 / 255)
        np.testing.assert_allclose(read.sh[:, 0], gaussians.sh[:, 0], atol=0.05)


def test_up_turns_what_formats_without_axes_hold(
    tmp_path: Path, gaussians: Gaussians, capsys
) -> None:
    """A scene trained with y down, converted with --up -y, stands in USD and SPZ, which know where up is."""
    gaussians.save(tmp_path / "a.npz")
    assert run(capsys, tmp_path / "a.npz", tmp_path / "down.ply", "--up", "-y")[0] == EXIT_OK
    raw = scene_files.read_scene(tmp_path / "down.ply").gaussians
    np.testing.assert_array_equal(raw.means[:, 1], -gaussians.means[:, 2])
    for name in ("b.usdz", "b.spz"):
        target = tmp_path / name
        assert run(capsys, tmp_path / "down.ply", target, "--up", "-y")[0] == EXIT_OK
        read = scene_files.read_scene(target).gaussians
        np.testing.assert_allclose(read.means, gaussians.means, atol=1e-5)


def test_broken_rows_are_dropped_on_request(tmp_path: Path, gaussians: Gaussians, capsys) -> None:
    from digs_warp.formats.splats.ply import write_ply

    gaussians.means[3] = np.nan
    write_ply(tmp_path / "a.ply", gaussians)
    code, text = run(capsys, tmp_path / "a.ply", tmp_path / "b.spz")
    assert code == EXIT_BAD_INPUT
    assert "--drop-broken" in text
    code, text = run(capsys, tmp_path / "a.ply", tmp_path / "b.spz", "--drop-broken")
    assert code == EXIT_OK
    assert "19 Gaussians" in text


def test_what_cannot_be_converted_is_said(tmp_path: Path, gaussians: Gaussians, capsys) -> None:
    for source, target, message in [
        ("none.ply", "b.spz", "no such file"),
        ("a.npz", "b.obj", "suffix '.obj', expected one of .npz, .ply"),
        ("a.npz", "a.npz", "the file exists"),
        ("capture", "b.ply", "a capture; add --to with one of colmap"),
        (".", "b.ply", "no gaussians.npz in it"),
    ]:
        gaussians.save(tmp_path / "a.npz")
        if source == "capture":
            write_tiny_capture(tmp_path / "capture", frames=2)
        before = sorted(tmp_path.rglob("*"))
        code, text = run(capsys, tmp_path / source, tmp_path / target)
        assert (code, message in text) == (EXIT_BAD_INPUT, True), text
        assert sorted(tmp_path.rglob("*")) == before


def classic(folder: Path) -> Path:
    """A reconstruction folder without a filter, beside its recording."""
    capture = write_tiny_capture(folder / "capture", frames=5)
    training, held_out = capture.split(4)
    PosedFrames(tuple(training), tuple(held_out)).save(folder / "result")
    ball().save(folder / "result/gaussians.npz")
    RunLog("reconstruct", {}).save(folder / "result/run.json")
    return folder / "result"


@pytest.mark.parametrize("suffix", scene_files.SPLATS_WRITABLE)
def test_files_for_classic_viewers_have_thinner_splats(tmp_path: Path, suffix: str, capsys) -> None:
    source = classic(tmp_path)
    scales = []
    for name, flags in (("plain", []), ("wide", ["--for-width", "2000"]), ("same", [])):
        made_for = [] if name == "plain" else ["--for", "classic"]
        target = tmp_path / f"{name}{suffix}"
        code, text = run(capsys, source, target, *made_for, *flags)
        assert code == EXIT_OK, text
        read = scene_files.read_scene(target).gaussians
        scales.append(np.median(read.scales))
        assert name == "plain" or read.screen_filter == CLASSIC
    assert scales[0] >= scales[1] > scales[2]
    code, text = run(capsys, tmp_path / f"same{suffix}", tmp_path / f"b{suffix}", "--for=classic")
    assert (code, "already made for viewers" in text) == (EXIT_BAD_INPUT, True), text


def test_what_no_file_for_classic_viewers_can_be_made_of(
    tmp_path: Path, gaussians: Gaussians, capsys
) -> None:
    gaussians.save(tmp_path / "a.npz")
    for target, flags, message in [
        ("b.usdz", ["--for", "classic"], "expected .ply, .compressed.ply, .spz"),
        ("b.ply", ["--for", "classic"], "no recording with cameras"),
        ("b.ply", ["--for-width", "640"], "--for-width needs --for classic"),
        ("a.npz", ["--overwrite"], "is the source itself"),
    ]:
        code, text = run(capsys, tmp_path / "a.npz", tmp_path / target, *flags)
        assert code != EXIT_OK and message in " ".join(text.split()), text
        assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_a_scene_of_thinner_splats_says_so(tmp_path: Path, gaussians, capsys) -> None:
    """USD has no attribute for it and its renderers add nothing; our own reading does."""
    for made_for, warns in ((NO_FILTER, False), (CLASSIC, True), (ANTIALIASED, True)):
        source, target = tmp_path / "a.ply", tmp_path / "b.usdz"
        write_splat_file(source, replace(gaussians, screen_filter=made_for))
        code, text = run(capsys, source, target, "--overwrite")
        assert (code, "show them thinner" in text) == (EXIT_OK, warns), text
        assert scene_files.read_scene(target).gaussians.screen_filter == made_for


def test_only_a_reconstruction_lends_its_record_to_usd(
    tmp_path: Path, gaussians: Gaussians, capsys
) -> None:
    """A foreign file is not said to have been trained as whatever lies beside it."""
    gaussians.save(tmp_path / "gaussians.npz")
    RunLog("reconstruct", {"iterations": 123}).save(tmp_path / "run.json")
    run(capsys, tmp_path / "gaussians.npz", tmp_path / "foreign.ply")
    for name in ("gaussians.npz", "foreign.ply"):
        assert run(capsys, tmp_path / name, tmp_path / f"{name}.usda")[0] == EXIT_OK
    ours, foreign = (
        read_scene(tmp_path / f"{name}.usda").metadata for name in ("gaussians.npz", "foreign.ply")
    )
    assert ours["settings"] == {"iterations": 123}
    assert "settings" not in foreign
    assert foreign["source"] == "foreign.ply"
