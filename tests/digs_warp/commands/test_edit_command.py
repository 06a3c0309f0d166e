"""`digs-warp edit`: what stays, where it goes, and that it looks the same from there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.data.capture import read_capture
from digs_warp.data.gaussians import CLASSIC, Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, matrix_from_rotation_vector
from digs_warp.splat.render import render
from reference.splat_scenes import random_gaussians
from reference.tiny_capture import ball, write_tiny_capture

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
