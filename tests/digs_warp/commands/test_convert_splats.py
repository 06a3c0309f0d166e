"""`digs-warp convert`, `edit` and `render` on Gaussians: formats, cuts and moves, films."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.data.capture import read_capture
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, NO_FILTER, Gaussians
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.formats.splats.files import write_splat_file
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, matrix_from_rotation_vector
from digs_warp.pipeline import scene_files
from digs_warp.record.run_log import RunLog
from digs_warp.splat.render import render
from digs_warp.usd.reader import read_scene
from reference.splat_files import random_gaussians as wild_gaussians
from reference.splat_files import shapes
from reference.splat_scenes import random_gaussians
from reference.tiny_capture import ball, write_tiny_capture

DEGREE = 1


@pytest.fixture
def gaussians() -> Gaussians:
    """What every format holds: colors within 0..1, no view dependence."""
    g = wild_gaussians(20, DEGREE)
    g.sh[:, 0] = g.sh[:, 0].clip(-1.5, 1.5)
    g.sh[:, 1:] = 0
    return g


def test_any_pair(tmp_path: Path, gaussians: Gaussians, run) -> None:
    """The scene survives, to the precision of the coarsest format."""
    for source, target in list(pairwise([*scene_files.WRITABLE, scene_files.WRITABLE[0]])):
        first, second, third = (
            tmp_path / f"{name}" for name in ("start.npz", "a" + source, "b" + target)
        )
        gaussians.save(first)
        assert run("convert", first, "--out", second)[0] == EXIT_OK
        code, text = run("convert", second, "--out", third)
        assert code == EXIT_OK, text
        assert "20 Gaussians" in text
        read = scene_files.read_scene(third).gaussians
        nearest = np.linalg.norm(read.means[:, None] - gaussians.means, axis=2).argmin(axis=0)
        read = read.select(nearest)  # some formats sort
        np.testing.assert_allclose(read.means, gaussians.means, atol=2e-3)
        np.testing.assert_allclose(shapes(read), shapes(gaussians), atol=0.4)
        np.testing.assert_allclose(read.opacities, gaussians.opacities, atol=1.1 / 255)
        np.testing.assert_allclose(read.sh[:, 0], gaussians.sh[:, 0], atol=0.05)


def test_up_turns_what_formats_without_axes_hold(tmp_path: Path, gaussians: Gaussians, run) -> None:
    """A scene trained with y down, converted with --up -y, stands in USD and SPZ, which know where up is."""
    gaussians.save(tmp_path / "a.npz")
    assert (
        run("convert", tmp_path / "a.npz", "--out", tmp_path / "down.ply", "--up", "-y")[0]
        == EXIT_OK
    )
    raw = scene_files.read_scene(tmp_path / "down.ply").gaussians
    np.testing.assert_array_equal(raw.means[:, 1], -gaussians.means[:, 2])
    for name in ("b.usdz", "b.spz"):
        target = tmp_path / name
        assert run("convert", tmp_path / "down.ply", "--out", target, "--up", "-y")[0] == EXIT_OK
        read = scene_files.read_scene(target).gaussians
        np.testing.assert_allclose(read.means, gaussians.means, atol=1e-5)


def test_broken_rows_are_dropped_on_request(tmp_path: Path, gaussians: Gaussians, run) -> None:
    from digs_warp.formats.splats.ply import write_ply

    gaussians.means[3] = np.nan
    write_ply(tmp_path / "a.ply", gaussians)
    code, text = run("convert", tmp_path / "a.ply", "--out", tmp_path / "b.spz")
    assert code == EXIT_BAD_INPUT
    assert "--drop-broken" in text
    code, text = run("convert", tmp_path / "a.ply", "--out", tmp_path / "b.spz", "--drop-broken")
    assert code == EXIT_OK
    assert "19 Gaussians" in text


def test_what_cannot_be_converted_is_said(tmp_path: Path, gaussians: Gaussians, run) -> None:
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
        code, text = run("convert", tmp_path / source, "--out", tmp_path / target)
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
def test_files_for_classic_viewers_have_thinner_splats(tmp_path: Path, suffix: str, run) -> None:
    source = classic(tmp_path)
    scales = []
    for name, flags in (("plain", []), ("wide", ["--for-width", "2000"]), ("same", [])):
        made_for = [] if name == "plain" else ["--for", "classic"]
        target = tmp_path / f"{name}{suffix}"
        code, text = run("convert", source, "--out", target, *made_for, *flags)
        assert code == EXIT_OK, text
        read = scene_files.read_scene(target).gaussians
        scales.append(np.median(read.scales))
        assert name == "plain" or read.screen_filter == CLASSIC
    assert scales[0] >= scales[1] > scales[2]
    code, text = run(
        "convert", tmp_path / f"same{suffix}", "--out", tmp_path / f"b{suffix}", "--for=classic"
    )
    assert (code, "already made for viewers" in text) == (EXIT_BAD_INPUT, True), text


def test_what_no_file_for_classic_viewers_can_be_made_of(
    tmp_path: Path, gaussians: Gaussians, run
) -> None:
    gaussians.save(tmp_path / "a.npz")
    for target, flags, message in [
        ("b.usdz", ["--for", "classic"], "expected .ply, .compressed.ply, .spz"),
        ("b.ply", ["--for", "classic"], "no recording with cameras"),
        ("b.ply", ["--for-width", "640"], "--for-width needs --for classic"),
        ("a.npz", ["--overwrite"], "is the source itself"),
    ]:
        code, text = run("convert", tmp_path / "a.npz", "--out", tmp_path / target, *flags)
        assert code != EXIT_OK and message in " ".join(text.split()), text
        assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_a_scene_of_thinner_splats_says_so(tmp_path: Path, gaussians, run) -> None:
    """USD has no attribute for it and its renderers add nothing; our own reading does."""
    for made_for, warns in ((NO_FILTER, False), (CLASSIC, True), (ANTIALIASED, True)):
        source, target = tmp_path / "a.ply", tmp_path / "b.usdz"
        write_splat_file(source, replace(gaussians, screen_filter=made_for))
        code, text = run("convert", source, "--out", target, "--overwrite")
        assert (code, "show them thinner" in text) == (EXIT_OK, warns), text
        assert scene_files.read_scene(target).gaussians.screen_filter == made_for


def test_only_a_reconstruction_lends_its_record_to_usd(
    tmp_path: Path, gaussians: Gaussians, run
) -> None:
    """A foreign file is not said to have been trained as whatever lies beside it."""
    gaussians.save(tmp_path / "gaussians.npz")
    RunLog("reconstruct", {"iterations": 123}).save(tmp_path / "run.json")
    run("convert", tmp_path / "gaussians.npz", "--out", tmp_path / "foreign.ply")
    for name in ("gaussians.npz", "foreign.ply"):
        assert run("convert", tmp_path / name, "--out", tmp_path / f"{name}.usda")[0] == EXIT_OK
    ours, foreign = (
        read_scene(tmp_path / f"{name}.usda").metadata for name in ("gaussians.npz", "foreign.ply")
    )
    assert ours["settings"] == {"iterations": 123}
    assert "settings" not in foreign
    assert foreign["source"] == "foreign.ply"


SCENE = random_gaussians(400, seed=3, degree=3)


def edit(tmp_path: Path, *arguments: object, target: str = "out.npz") -> Gaussians:
    SCENE.save(tmp_path / "a.npz")
    out = tmp_path / target
    words = ["edit", tmp_path / "a.npz", *arguments, "--out", out, "--overwrite"]
    assert main([*map(str, words)]) == EXIT_OK
    return Gaussians.load(out)


@pytest.mark.parametrize("target", ["out.npz", "out.ply", "out.glb", "out.usdz"])
def test_what_is_moved_looks_the_same_from_there(tmp_path: Path, target: str) -> None:
    flags = "--scale 2.5 --turn 90 0 70 --move 1 -2 3".split()  # about x, then about z
    there = edit(tmp_path, *flags, target=target)
    about_x, about_z = map(matrix_from_rotation_vector, np.radians([[90.0, 0, 0], [0, 0, 70.0]]))
    rotation = about_z @ about_x
    view = look_at(np.array([0.9, 0.3, 0.4]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    moved = view.copy()
    moved[:3, :3] = rotation @ view[:3, :3]
    moved[:3, 3] = 2.5 * rotation @ view[:3, 3] + [1, -2, 3]
    k = Intrinsics.from_fov(48, 40, 50.0)
    before, after = (render(g, Camera(k, m)).image for g, m in ((SCENE, view), (there, moved)))
    np.testing.assert_allclose(after, before, atol=2e-4)
    assert np.ptp(before) > 0.5


def test_a_box_floaters_and_faint_splats_are_cut(tmp_path: Path) -> None:
    box = edit(tmp_path, *"--keep-box -0.1 -0.2 0 0.1 0.2 9".split())
    low, high = box.means.min(axis=0), box.means.max(axis=0)
    assert 0 < len(box) < 400 and (low >= [-0.1, -0.2, 0]).all() and (high <= [0.1, 0.2, 9]).all()
    opaque = edit(tmp_path, "--min-opacity", 0.5)
    assert len(opaque) == (SCENE.opacities >= 0.5).sum()
    SCENE.means[7] = (40.0, 0.0, 0.0)
    try:
        left = edit(tmp_path, "--remove-floaters")
    finally:
        SCENE.means[7] = 0.0
    assert len(left) == 399 and left.means.max() < 5
    assert 100 <= len(edit(tmp_path, "--share", 0.5)) <= 200


def test_masks_cut_what_they_do_not_show(tmp_path: Path) -> None:
    capture = write_tiny_capture(tmp_path / "capture", frames=5)
    inside = ball()
    centers = [frame.camera.center_world for frame in capture.frames]
    outside = inside.select(slice(0, 50))
    outside = replace(outside, means=outside.means + 0.4 * (centers[0] - inside.means.mean(axis=0)))
    for name, part in (("in", inside), ("beside", outside)):
        part.save(tmp_path / f"{name}.ply")
    words = ["edit", tmp_path / "in.ply", tmp_path / "beside.ply", "--keep-inside"]
    words += [tmp_path / "capture", "--out", tmp_path / "b.ply"]
    assert main([*map(str, words)]) == EXIT_OK
    kept = Gaussians.load(tmp_path / "b.ply")
    assert 0.8 * len(inside) < len(kept) < len(inside) + 25
    assert read_capture(tmp_path / "capture").frames


def test_several_become_one_with_the_higher_degree(tmp_path: Path, capsys) -> None:
    plain = random_gaussians(30, seed=5, degree=0)
    plain.save(tmp_path / "b.npz")
    both = edit(tmp_path, tmp_path / "b.npz")
    assert len(both) == 430 and both.sh_degree == 3
    np.testing.assert_array_equal(both.sh[400:, :1], plain.sh)
    replace(plain, screen_filter=CLASSIC).save(tmp_path / "b.npz")
    words = ["edit", tmp_path / "a.npz", tmp_path / "b.npz", "--out", tmp_path / "c.npz"]
    assert main([*map(str, words)]) == EXIT_BAD_INPUT
    assert "different renderers" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "message", "code"),
    [
        ("--keep-box 1 1 1 0 0 0", "expected its lowest x, y, z", EXIT_BAD_INPUT),
        ("--keep-box 50 50 50 51 51 51", "no Gaussian is left", EXIT_BAD_INPUT),
        ("--share 0", "--share: 0", EXIT_WRONG_USAGE),
        ("--keep-inside none", "no such", EXIT_BAD_INPUT),
    ],
)
def test_what_cannot_be_is_said(
    tmp_path: Path, flags: str, message: str, code: int, capsys
) -> None:
    SCENE.save(tmp_path / "a.npz")
    out = tmp_path / "b.ply"
    words = ["edit", tmp_path / "a.npz", "--out", out, *flags.split()]
    assert main([*map(str, words)]) == code
    captured = capsys.readouterr()
    assert message in captured.err + captured.out
    assert not out.exists()


SMALL = ["--width", "64", "--height", "48", "--seconds", "0.1"]


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    ball().save(tmp_path / "reconstruction/gaussians.npz")
    return tmp_path / "reconstruction"


def test_a_video_and_how_fast_it_was(tmp_path: Path, scene: Path, run) -> None:
    code, text = run("render", *SMALL, scene, "--out", tmp_path / "a.mp4")
    assert code == EXIT_OK, text
    assert "3 frames of 64x48 px, 1,500 Gaussians" in text
    assert "frames/s" in text
    assert (tmp_path / "a.mp4").is_file()
    assert run("render", *SMALL, scene, "--out", tmp_path / "a.mp4")[0] == EXIT_BAD_INPUT
    assert run("render", *SMALL, scene, "--out", tmp_path / "a.mp4", "--overwrite")[0] == EXIT_OK


def test_what_cannot_be_filmed_is_said(tmp_path: Path, scene: Path, run) -> None:
    for name, flags, message in [
        ("a.avi", [], "suffix '.avi', expected .mp4 or .gif"),
        ("a.mp4", ["--follow", "none"], "no such folder"),
    ]:
        code, text = run("render", *SMALL, scene, "--out", tmp_path / name, *flags)
        assert (code, message in text) == (EXIT_BAD_INPUT, True), text
        assert not list(tmp_path.glob("a.*"))


def test_along_the_path_of_a_capture(tmp_path: Path, scene: Path, run) -> None:
    """The first frame of the film is the first photograph, but for the size."""
    capture = write_tiny_capture(tmp_path / "capture", frames=4)
    code, text = run(
        "render",
        *SMALL,
        *(scene, "--out", tmp_path / "film.mp4", "--follow", tmp_path / "capture"),
        *("--background", 0, 0, 0),
    )
    assert code == EXIT_OK, text
    film = cv2.VideoCapture(str(tmp_path / "film.mp4")).read()[1][..., ::-1].astype(float)
    photograph = capture.frames[0].load_image()  # 72 x 54
    rows = ((np.arange(48) + 0.5) * 54 / 48).astype(int)
    columns = ((np.arange(64) + 0.5) * 72 / 64).astype(int)
    mask = capture.frames[0].load_mask()[rows][:, columns] > 250
    assert np.abs(film - photograph[rows][:, columns])[mask].mean() < 12
