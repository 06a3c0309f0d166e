"""What a page shows of files and folders, its switches in a real browser, and what its server gives."""

import json
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from headless_browser import Browser, NoBrowserError, browser

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import read_image
from digs_warp.geometry.sh import C0, sh_from_rgb
from digs_warp.show.view.contents import NAME, Contents, Stage, read_contents, sensed_points
from digs_warp.show.view.layers import load_picture, pictures_of, points_as_splats
from digs_warp.show.view.server import started
from digs_warp.train.training import save_snapshot
from reference.report_folder import write_capture, write_reconstruction
from reference.tiny_capture import ball


@pytest.fixture
def capture(tmp_path: Path) -> Capture:
    return write_capture(tmp_path / "capture")


def test_a_capture_has_its_views_and_its_depth_as_points_of_its_colors(capture: Capture) -> None:
    contents = read_contents(capture.folder)
    assert (contents.name, len(contents.frames), contents.stages) == ("capture", len(capture), ())
    cloud = contents.points[NAME]
    # Depth of 1 to 1.3 m on the disc and 4 m around it, seen from a circle of 1 m.
    assert len(cloud) > 1000
    away = np.linalg.norm(cloud.points_world - [0, 0, 0.3], axis=1)
    assert 0 < away.min() and away.max() < 6
    frame = capture.frames[0]
    one = sensed_points([frame])[NAME]
    columns, rows = frame.camera.project(one.points_world.astype(np.float64))[0].astype(int).T
    np.testing.assert_allclose(one.colors, frame.load_image()[rows, columns] / 255, atol=1e-6)
    points = points_as_splats(cloud, 2.0)
    np.testing.assert_allclose(0.5 + C0 * points.sh[:, 0], cloud.colors, atol=1e-6)
    np.testing.assert_allclose(points.scales, 0.006, rtol=1e-5)


def test_a_reconstruction_has_its_start_and_every_snapshot(
    capture: Capture, tmp_path: Path
) -> None:
    folder = tmp_path / "reconstruction"
    write_reconstruction(folder, capture)
    for iteration in (0, 100):
        save_snapshot(folder, iteration, ball())
    contents = read_contents(folder)
    assert [stage.label for stage in contents.stages] == ["iteration 0", "iteration 100", "result"]
    assert "start" in contents.points
    assert NAME in contents.points
    assert len(contents.frames) == len(capture)
    assert contents.name == tmp_path.name  # of the run, not 'reconstruction'
    assert any("dB" in fact for fact in contents.facts)


def test_what_cannot_be_shown_is_told(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="no such file or folder"):
        read_contents(tmp_path / "nothing")
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(DigsError, match=r"notes\.txt"):
        read_contents(tmp_path / "notes.txt")
    ball().select(slice(0, 0)).save(tmp_path / "empty.npz")
    with pytest.raises(DigsError, match="0 Gaussians"):
        read_contents(tmp_path / "empty.npz")


def test_the_pictures_in_the_cameras(capture: Capture) -> None:
    frames = tuple(capture.frames)
    assert pictures_of(frames) == ["photograph", "measured depth"]
    photo = load_picture(frames[0], "photograph")
    depth = load_picture(frames[0], "measured depth")
    assert photo is not None and depth is not None
    assert np.array_equal(photo, frames[0].load_image())
    assert (depth[:, :5] == 128).all()  # nothing was measured there
    assert (depth[:, 5:] != 128).any(axis=-1).all()
    assert load_picture(frames[0], "why depth is missing") is None


def test_the_view_begins_where_all_is_seen(capture: Capture) -> None:
    moved = replace(ball(), means=ball().means + np.array([5.0, 0.0, 0.0], np.float32))
    first = Contents("a", stages=(Stage("result", moved),)).first_view()
    px, depth = first.camera.project(moved.means.astype(np.float64))
    k = first.camera.intrinsics
    assert (depth > 0).all() and ((px >= 0) & (px <= [k.width, k.height])).all()
    frames = tuple(capture.frames)  # an object is seen from the side that was recorded first
    side = Contents("b", stages=(Stage("result", ball()),), frames=frames).first_view()
    assert (side.camera.center_world - side.target) @ frames[0].camera.center_world > 0.5
    recorded = read_contents(capture.folder).first_view()  # nothing says what the object is
    pose = capture.frames[0].camera.world_from_cam
    np.testing.assert_array_equal(recorded.camera.world_from_cam, pose)


# The scene's part of the window, without the panel at its right.
SCENE = (slice(20, 560), slice(20, 500))
RED, BLUE = (0.9, 0.1, 0.1), (0.1, 0.1, 0.9)


def tinted(color: tuple[float, float, float]) -> Gaussians:
    plain = ball()
    sh = np.tile(sh_from_rgb(np.array(color)), (len(plain), 1, 1)).astype(np.float32)
    opaque = np.full(len(plain), 4.0)
    return Gaussians(plain.means, plain.log_scales, plain.quats, opaque, sh)


@pytest.fixture
def address() -> Iterator[str]:
    stages = (Stage("iteration 0", tinted(RED)), Stage("result", tinted(BLUE)))
    with started([Contents("ball", ("a fact",), stages)], "127.0.0.1", 8080) as address:
        yield address


def colored(picture: np.ndarray) -> np.ndarray:
    """How many pixels of the scene are red, and how many blue."""
    r, _, b = np.moveaxis(picture[SCENE].astype(int), -1, 0)
    return np.array([np.count_nonzero(r - b > 60), np.count_nonzero(b - r > 60)])


def wait_until(tab: Browser, is_so: Callable[[np.ndarray], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not is_so(found := colored(tab.screenshot())):
        assert time.monotonic() < end, f"red, blue: {found}"
        time.sleep(0.3)


def choose(tab: Browser, switch: str, value: float) -> None:
    """Set the switch whose label begins with these words, and wait a second."""
    tab.run(
        "(() => { const label = [...document.querySelectorAll('.panel label')]"
        f".find((each) => each.textContent.startsWith({json.dumps(switch)}));"
        f"const input = label.querySelector('input, select'); input.value = {value};"
        "for (const kind of ['input', 'change']) input.dispatchEvent(new Event(kind)); })()"
    )
    tab.run("new Promise((done) => setTimeout(done, 1000))")


@pytest.fixture
def tab(tmp_path: Path) -> Iterator[Browser]:
    try:
        with browser(tmp_path / "profile") as opened:
            yield opened
    except NoBrowserError as error:
        pytest.skip(str(error))


@pytest.mark.long
def test_the_page_shows_what_its_switches_say(address: str, tab: Browser) -> None:
    tab.visit(address)
    wait_until(tab, lambda found: found[1] > 1000 and found[0] == 0)
    choose(tab, "Training", 0.0)
    wait_until(tab, lambda found: found[0] > 1000 and found[1] == 0)
    assert "iteration 0" in tab.run("document.querySelector('.panel').textContent")
    choose(tab, "Drawn", 1)
    r, g, b = np.moveaxis(tab.screenshot()[SCENE].astype(int), -1, 0)
    assert np.count_nonzero((r > 180) & (g > 180) & (b < 120)) > 1000  # near is yellow
    assert np.count_nonzero((g > r + 30) & (b > r)) > 500  # far is blue and green
    choose(tab, "Drawn", 2)
    normals = tab.screenshot()[SCENE].astype(int)
    assert np.ptp(normals[(normals.min(axis=2) < 250)], axis=0).min() > 100
    tab.click("input[name=gaussians]")
    wait_until(tab, lambda found: found.sum() == 0)


@pytest.mark.long
def test_several_stand_side_by_side_or_one_by_one(tab: Browser) -> None:
    contents = [Contents("same name", stages=(Stage("result", tinted(c)),)) for c in (RED, BLUE)]
    with started(contents, "127.0.0.1", 8080) as address:
        tab.visit(address)
        wait_until(tab, lambda found: found.min() > 500)
        middles = [
            np.flatnonzero((sign * (picture[..., 0] - picture[..., 2]) > 60).any(axis=0)).mean()
            for picture in (tab.screenshot()[SCENE].astype(int),)
            for sign in (1, -1)
        ]
        assert middles[0] + 50 < middles[1]
        choose(tab, "Compare", 2)
        wait_until(tab, lambda found: found[1] > 1000 and found[0] == 0)


def answer(url: str) -> bytes:
    with urllib.request.urlopen(url) as found:
        return found.read()


def test_the_server_gives_what_the_page_asks_for_and_nothing_else(tmp_path: Path) -> None:
    capture = write_capture(tmp_path / "capture")
    write_reconstruction(tmp_path / "reconstruction", capture)
    with started([read_contents(tmp_path / "reconstruction")], "127.0.0.1", 8080) as address:
        assert b"view3d-about" in answer(address)
        assert len(answer(f"{address}/splats/0/gaussians/0")) == 1234 * 20
        assert len(answer(f"{address}/splats/0/start/0")) == 987 * 20
        frame = capture.frames[3].name
        (tmp_path / "a.jpg").write_bytes(answer(f"{address}/picture/0/{frame}/measured%20depth"))
        assert read_image(tmp_path / "a.jpg").shape == capture.frames[3].load_image().shape
        for path in ("splats/0/no/0", "splats/1/gaussians/0", "picture/0/x/photograph", "../x"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                answer(f"{address}/{path}")


def test_a_taken_port_gives_the_next_and_a_foreign_address_an_error(address: str) -> None:
    contents = [Contents("ball", stages=(Stage("result", ball()),))]
    with started(contents, "127.0.0.1", int(address.rpartition(":")[2])) as other:
        assert other != address
    with (
        pytest.raises(DigsError, match="cannot listen there"),
        started(contents, "192.0.2.1", 8080),
    ):
        pass
