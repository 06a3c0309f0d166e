"""The page in a real browser: what its switches show, by its pixels."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from headless_browser import Browser, NoBrowserError, browser

from digs_warp.data.gaussians import Gaussians
from digs_warp.pipeline.scene_files import read_scene
from digs_warp.show.view.contents import Contents, Stage
from digs_warp.show.view.controls import SIDE_BY_SIDE
from digs_warp.show.view.page import Page
from digs_warp.show.view.server import live_page, started
from digs_warp.splat.device import DeviceGaussians
from reference.tiny_capture import ball

# The scene's part of the window, without the panel at its right and the notes at its left.
SCENE = (slice(150, 600), slice(150, 600))


def tinted(color: tuple[float, float, float]) -> Gaussians:
    from digs_warp.geometry.sh import sh_from_rgb

    plain = ball()
    sh = np.tile(sh_from_rgb(np.array(color)), (len(plain), 1, 1)).astype(np.float32)
    opaque = np.full(len(plain), 4.0)
    return Gaussians(plain.means, plain.log_scales, plain.quats, opaque, sh)


@pytest.fixture
def page() -> Iterator[tuple[Page, str]]:
    stages = (
        Stage("iteration 0", tinted((0.9, 0.1, 0.1))),
        Stage("result", tinted((0.1, 0.1, 0.9))),
    )
    with started([Contents("ball", ("a fact",), stages)], "127.0.0.1", 8080) as (page, address):
        yield page, address


def colored(picture: np.ndarray) -> np.ndarray:
    """How many pixels of the scene are red, and how many blue."""
    r, _, b = np.moveaxis(picture[SCENE].astype(int), -1, 0)
    return np.array([np.count_nonzero(r - b > 60), np.count_nonzero(b - r > 60)])


def wait_until(
    tab: Browser, is_so: Callable[[np.ndarray], bool], seconds: float = 180.0
) -> np.ndarray:
    end = time.monotonic() + seconds
    while True:
        picture = tab.screenshot()
        if is_so(colored(picture)):
            return picture
        assert time.monotonic() < end, f"red, blue: {colored(picture)}"
        time.sleep(0.3)


@pytest.fixture
def tab(tmp_path: Path) -> Iterator[Browser]:
    try:
        with browser(tmp_path / "profile") as opened:
            yield opened
    except NoBrowserError as error:
        pytest.skip(str(error))


@pytest.mark.long
def test_the_page_shows_what_its_switches_say(page: tuple[Page, str], tab: Browser) -> None:
    shown, address = page
    controls = shown.controls
    tab.visit(address)
    wait_until(tab, lambda found: found[1] > 1000 and found[0] == 0)
    controls.stage.value = 0.0
    wait_until(tab, lambda found: found[0] > 1000 and found[1] == 0)
    browsers_own = tab.screenshot()
    controls.drawn.value = "color"
    ours = wait_until(tab, lambda found: found[0] > 1000)
    # Both draw the same scene: the browser sorts and rounds in other ways.
    difference = np.abs(browsers_own[SCENE].astype(int) - ours[SCENE].astype(int))
    assert difference.mean() < 6
    controls.drawn.value = "depth"
    wait_until(tab, lambda found: found.min() > 1000)  # near is yellow, far is blue
    controls.layers["gaussians"].value = False
    wait_until(tab, lambda found: found.sum() == 0)


@pytest.mark.long
def test_a_training_is_shown_while_it_runs(tab: Browser) -> None:
    red, blue = (
        DeviceGaussians.from_numpy(tinted(color)) for color in ((0.9, 0.1, 0.1), (0.1, 0.1, 0.9))
    )
    addresses: list[str] = []
    with live_page(addresses.append) as watch:
        watch(10, red)
        tab.visit(addresses[0])
        wait_until(tab, lambda found: found[0] > 1000)
        iteration = 20
        end = time.monotonic() + 180
        while colored(tab.screenshot())[1] < 1000:
            watch(iteration, blue)
            iteration += 10
            time.sleep(0.1)
            assert time.monotonic() < end
    assert len(addresses) == 1


def test_the_box_cuts_and_the_button_saves(page: tuple[Page, str], tmp_path: Path) -> None:
    shown, _ = page
    controls = shown.controls
    controls.box_center.value = (4.0, 0.0, 0.0)
    controls.cuts.value = True
    target = tmp_path / "half.ply"
    said = shown.save(target)
    assert target.is_file(), said
    saved = read_scene(target).gaussians
    assert 0.3 < len(saved) / len(ball()) < 0.7
    assert "exists" in shown.save(target)


def test_results_of_a_recording_stand_side_by_side_or_one_by_one_in_the_same_place(
    tmp_path: Path,
) -> None:
    """The second is seen smaller where both have one scale, and is what is saved when it stands alone."""
    red, blue = tinted((0.9, 0.1, 0.1)), tinted((0.1, 0.1, 0.9))
    part = blue.select(blue.means[:, 2] > np.median(blue.means[:, 2]))
    contents = [
        Contents(name, stages=(Stage("result", gaussians),), recording=tmp_path)
        for name, gaussians in (("same name", red), ("same name", part))
    ]
    with started(contents, "127.0.0.1", 8080) as (page, _):

        def places() -> list[np.ndarray]:
            shown = (page._page_gaussians(number) for number in (0, 1))
            return [each.means for each in shown if each is not None]

        first, second = places()
        assert second[:, 0].min() > first[:, 0].max()
        page.controls.standing.value = "1: same name"
        alone = places()[0]
        assert page.controls.shows(0, "gaussians") and not page.controls.shows(1, "gaussians")
        page.controls.standing.value = "2: same name"
        assert page.controls.shows(1, "gaussians") and not page.controls.shows(0, "gaussians")
        half = alone[red.means[:, 2] > np.median(red.means[:, 2])]
        np.testing.assert_allclose(places()[1], half, atol=1e-5)
        page.save(tmp_path / "second.ply")
        assert len(read_scene(tmp_path / "second.ply").gaussians) == len(part)
        page.controls.standing.value = SIDE_BY_SIDE
        np.testing.assert_array_equal(places()[1], second)
