"""The main job, small: mesh -> capture -> Gaussians -> USD, by the command that users type."""

import json
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import main
from digs_warp.data.capture import read_capture
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.data.images import read_image
from digs_warp.measure.metrics import psnr
from digs_warp.splat.render import render
from digs_warp.usd.reader import read_scene
from reference.usd_renderer import render_usd

# A device needs more pixels than these: its depth is rougher per pixel of a small image.
SIZES = ["--profile", "bare-matcher", "--frames", "18", "--width", "160", "--height", "90"]
SIZES += ["--iterations", "150"]
# A pixel is 6 mm at the object: finer voxels would only cost time. At this size the edge pixels, in which
# object and surround mix, hold the quality down; the floors are about 1 dB below what was seen.
COARSE = ["--voxel-size", "0.005"]


def run(folder: Path, *arguments: str) -> dict[str, float]:
    """Run the main job and return the mean metrics of the held-out views."""
    assert main(["run", "--out", str(folder), *SIZES, *COARSE, *arguments]) == 0
    return json.loads((folder / "reconstruction" / "evaluation.json").read_text())["mean"]


def check_results(folder: Path) -> None:
    """The USD scene holds the trained Gaussians; the report stands alone; pictures are pictures."""
    trained = Gaussians.load(folder / "reconstruction" / "gaussians.npz")
    scene = read_scene(folder / "scene.usdz")
    for name in FIELDS:
        found, expected = getattr(scene.gaussians, name), getattr(trained, name)
        if name == "quats":
            expected = expected / np.linalg.norm(expected, axis=1, keepdims=True)
            found = found * np.sign((found * expected).sum(axis=1, keepdims=True))
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4, err_msg=name)
    assert scene.metadata["kernel"]["dilation_px2"] == 0
    check_elsewhere(trained, folder)
    assert scene.metadata["held_out"]["psnr_frame"] > 0
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert "<img" in report
    assert 'src="http' not in report
    capture = read_capture(folder / "capture")
    assert len(capture) == 18
    held_out = capture.split()[1][0].name
    rendered = read_image(folder / "reconstruction" / "renders" / f"{held_out}.png")
    assert rendered.shape == (90, 160, 3)
    # White around the object (stray depth leaves a faint haze after so few steps), and an object that is not.
    assert (rendered[0] > 245).all()
    assert (rendered < 200).any()


def check_elsewhere(trained: Gaussians, folder: Path) -> None:
    """A renderer of USD that shares no code with us and adds nothing to splats shows what we show."""
    views = read_capture(folder / "capture").frames
    for number in (0, 8):  # time code i is view i, held out ones too
        camera = views[number].camera
        ours = render(trained, camera).image
        theirs = render_usd(folder / "scene.usdz", "/Asset/Rig/left", number, np.ones(3))
        assert psnr(theirs, ours) > 45
        recorded = views[number].load_image().astype(np.float32) / 255
        inside = views[number].load_mask() > 127
        mine, other = (psnr(image, recorded, inside) for image in (ours, theirs))
        # Of the 0.01 px^2 that ours adds: up to 0.41 dB at this size, 0.03 dB at 640x360.
        assert other == pytest.approx(mine, abs=0.5)
        assert mine > 12


def test_the_built_in_object_ends_as_a_usd_scene(tmp_path: Path) -> None:
    mean = run(tmp_path / "out")
    assert mean["psnr_frame"] > 25  # 26.3 dB when this was written
    assert mean["psnr_object"] > 17.5
    check_results(tmp_path / "out")


@pytest.mark.long
@pytest.mark.parametrize(("mesh", "floor"), [("ycb_mustard_bottle", 27.0), ("avocado", 23.0)])
def test_a_real_mesh_ends_as_a_usd_scene(
    tmp_path: Path, sample_data: Path, mesh: str, floor: float
) -> None:
    mean = run(
        tmp_path / "out",
        "--mesh",
        str(sample_data / f"meshes/{mesh}/{mesh}.glb"),
        *("--object-size", "0.5"),
        "--environment",
        str(sample_data / "envs/forest_slope/forest_slope_1k.hdr"),
    )
    assert mean["psnr_frame"] > floor
    check_results(tmp_path / "out")
