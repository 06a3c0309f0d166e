"""The report in a real browser: what its 3D view draws, by its pixels, and that it needs nothing else."""

import base64
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from headless_browser import Browser, NoBrowserError, browser

from digs_warp.data.capture import read_capture
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, Gaussians, ScreenFilter
from digs_warp.data.images import to_uint8
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.view3d.section import first_view
from digs_warp.show.report.view3d.start import FirstView
from digs_warp.splat.render import render
from reference.report_folder import report_on, write_capture, write_reconstruction
from reference.tiny_capture import ball

pytestmark = pytest.mark.long

CANVAS = "document.querySelector('#view3d canvas')"
UP = np.array([0.0, 0.0, 1.0])


def needles() -> Gaussians:
    """A ball of long and flat Gaussians, some of them half transparent, with gloss of degree 3."""
    rng = np.random.default_rng(1)
    plain = ball(600)
    return Gaussians(
        plain.means,
        np.log(rng.uniform(0.003, 0.03, (600, 3))),
        rng.normal(size=(600, 4)),
        rng.uniform(-1.0, 3.0, 600),
        np.concatenate([plain.sh[:, :1], rng.normal(0.0, 0.15, (600, 15, 3))], axis=1),
    )


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a recording from which the needles were reconstructed."""
    folder = tmp_path_factory.mktemp("report")
    capture = write_capture(folder / "capture")
    write_reconstruction(folder / "reconstruction", capture)
    needles().save(folder / "reconstruction/gaussians.npz")
    (folder / "scene.usdz").write_bytes(b"stands for a scene")
    report_on((capture, folder / "reconstruction", folder / "report.html"))
    return folder / "report.html"


def opened(page: Path, tmp: Path, *flags: str) -> Iterator[Browser]:
    try:
        with browser(tmp / "profile", flags=flags) as tab:
            tab.resize(1280, 900)
            tab.visit(page.as_uri())
            yield tab
    except NoBrowserError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def tab(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    yield from opened(page, tmp_path_factory.mktemp("browser"))


def place_of(tab: Browser) -> tuple[float, float, float, float]:
    """The left and upper side of the canvas in the window, its width and height [px]."""
    box = tab.run(f"JSON.parse(JSON.stringify({CANVAS}.getBoundingClientRect()))")
    return box["x"], box["y"], box["width"], box["height"]


def drawn(tab: Browser) -> np.ndarray:
    """The pixels of the view at full detail."""
    tab.run(f"{CANVAS}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
    tab.wait_for(f"{CANVAS}.dataset.detail === '1'")
    tab.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    x, y, width, height = map(round, place_of(tab))
    shown, before = tab.screenshot(), None
    # A busy machine may be a frame behind.
    while before is None or not np.array_equal(shown, before):
        shown, before = tab.screenshot(), shown
    return shown[y : y + height, x : x + width]


def press(tab: Browser, key: str, times: int = 1) -> None:
    tab.run(f"{CANVAS}.focus()")
    for _ in range(times):
        tab.press(key)


def stored(page: Path) -> tuple[Reconstruction, FirstView]:
    result = Reconstruction.load(page.parent / "reconstruction")
    assert result.frames is not None
    return result, first_view(result, result.frames)


def by_engine(page: Path, picture: np.ndarray, turned_deg: float = 0.0) -> np.ndarray:
    """What our rasterizer draws from where the view begins, turned around the vertical."""
    result, first = stored(page)
    angle = np.deg2rad(turned_deg)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    eye = first.target + turn @ (first.camera.center_world - first.target)
    height, width = picture.shape[:2]
    focal = min(width, height) * first.camera.intrinsics.fy / first.camera.intrinsics.height
    k = Intrinsics(width, height, focal, focal, width / 2, height / 2)
    camera = Camera(k, look_at(eye, first.target, UP))
    return to_uint8(render(result.gaussians, camera, background=(1.0, 1.0, 1.0)).image)


def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(a.astype(int) - b.astype(int))[3:-3, 3:-3]


@pytest.mark.parametrize("made_for", [CLASSIC, ANTIALIASED])
def test_the_view_adds_what_the_splats_are_made_for(
    page: Path, tmp_path: Path, made_for: ScreenFilter
) -> None:
    work = shutil.copytree(page.parent, tmp_path / "work")
    folder, copied = work / "reconstruction", work / "report.html"
    thin = replace(needles(), log_scales=needles().log_scales - 2.0)
    replace(thin, screen_filter=made_for).save(folder / "gaussians.npz")
    report_on((read_capture(work / "capture"), folder, copied))
    for tab in opened(copied, tmp_path):
        tab.wait_for(f"{CANVAS}.dataset.drawn")
        found = drawn(tab)
        right = difference(found, by_engine(copied, found)).mean()
        thin.save(folder / "gaussians.npz")
        wrong = difference(found, by_engine(copied, found)).mean()
        assert 3 * right < wrong, (right, wrong)


def test_keys_buttons_mouse_and_fingers_move_what_the_engine_draws(
    page: Path, tab: Browser
) -> None:
    tab.wait_for(f"{CANVAS}.dataset.drawn")
    first = drawn(tab)
    assert first.shape[1] > 400 and (first.min(axis=2) < 200).mean() > 0.2
    assert difference(first, by_engine(page, first)).mean() < 1.5
    left, top, width, height = place_of(tab)
    x, y, scrolled = left + width / 2, top + height / 2, tab.run("scrollY")

    def extent(picture: np.ndarray) -> tuple[float, float]:
        """The width of what is seen, and its middle [px]."""
        inside = picture[3:-3, 3:-3]  # without the outline
        seen = np.flatnonzero((inside.min(axis=2) < 240).any(axis=0))
        return float(np.ptp(seen)), float(seen.mean())

    wide, middle = extent(first)
    tab.drag((x, y), (x + 60, y + 20))
    assert difference(drawn(tab), first).mean() > 5
    press(tab, "0")
    press(tab, "+", 3)
    assert extent(drawn(tab))[0] > 1.15 * wide
    tab.click("#view3d button[data-key='0']")
    assert difference(drawn(tab), first).max() == 0
    tab.click("#view3d button[data-key='-']")
    assert extent(drawn(tab))[0] < 0.95 * wide
    press(tab, "0")
    # A drag across the whole view is 216 degrees: 40 degrees to the right, as 8 arrow keys.
    across = min(width, height) * 40 / 216
    for turn in (
        lambda: tab.touch([(x, y)], [(x - across / 2, y)], [(x - across, y)]),
        lambda: press(tab, "ArrowRight", 8),
    ):
        turn()
        turned = drawn(tab)
        assert difference(turned, by_engine(page, turned, turned_deg=40)).mean() < 1.5
        press(tab, "0")
    tab.touch([(x - 45, y), (x + 45, y)], [(x - 36, y), (x + 36, y)], [(x - 30, y), (x + 30, y)])
    assert extent(drawn(tab))[0] == pytest.approx(wide / 1.5, rel=0.1)
    press(tab, "0")
    tab.touch([(x - 30, y), (x + 30, y)], [(x, y), (x + 60, y)])
    assert extent(drawn(tab))[1] == pytest.approx(middle + 30, abs=8)
    press(tab, "0")
    # Fingers that were lifted are forgotten, and the page under them has not scrolled.
    assert difference(drawn(tab), first).max() == 0
    assert tab.run("scrollY") == scrolled


def test_cameras_differ_by_shape_and_a_click_shows_what_one_saw(page: Path, tab: Browser) -> None:
    legend = "getComputedStyle(document.querySelector('#view3d .swatches')).display"
    assert tab.run(legend) == "none"
    tab.click("#view3d input")
    r, _, b = np.moveaxis(drawn(tab).astype(int), -1, 0)
    assert np.count_nonzero(b - r > 90) > 200  # training
    assert np.count_nonzero(r - b > 120) > 200  # held out
    assert tab.run(legend) == "flex"
    assert "with a cross" in tab.run("document.querySelector('#view3d .swatches').textContent")
    result, first = stored(page)
    assert result.frames is not None
    left, top, width, height = place_of(tab)
    away = first.camera.center_world - first.target
    zoom = tab.run(
        "JSON.parse(document.getElementById('view3d-about').textContent).contents[0].cameras.zoom"
    )
    # The camera that stands nearest to the eye is not hidden by others.
    eyes = [frame.camera.center_world for frame, _ in result.frames.by_time]
    nearest = np.argmin([np.linalg.norm(eye - first.target - 3 * away) for eye in eyes])
    chosen = result.frames.by_time[int(nearest)][0].camera
    k = first.camera.intrinsics
    focal = min(width, height) * k.fy / k.height
    pose = look_at(first.target + zoom * away, first.target, UP)
    seen = Camera(Intrinsics(1, 1, focal, focal, 0.0, 0.0), pose)
    ((x, y),), _ = seen.project(chosen.center_world[None])
    place = (left + width / 2 + x, top + height / 2 + y)
    tab.drag(place, place)
    found = drawn(tab)
    assert not tab.run("document.querySelector('#view3d input').checked")
    height, width = found.shape[:2]
    k = chosen.intrinsics
    focal = min(width / k.width, height / k.height) * k.fx
    as_seen = Intrinsics(width, height, focal, focal, width / 2, height / 2)
    camera = Camera(as_seen, chosen.world_from_cam)
    theirs = to_uint8(render(result.gaussians, camera, background=(1.0, 1.0, 1.0)).image)
    assert difference(found, theirs).mean() < 1.5
    press(tab, "0")


def test_the_page_answers_in_sight_is_short_and_prints_on_few_pages(tab: Browser) -> None:
    bottom = "document.querySelector('.cards').getBoundingClientRect().bottom + scrollY"
    tab.resize(1280, 800)
    assert tab.run(bottom) <= 800
    assert tab.run(f"{CANVAS}.getBoundingClientRect().top + scrollY") < 200
    assert tab.run("document.documentElement.scrollHeight") <= 5000
    assert tab.run("[...document.images].every((image) => image.complete)")
    pdf = base64.b64decode(tab._call("Page.printToPDF")["data"])
    assert pdf.count(b"/Type /Page") - pdf.count(b"/Type /Pages") <= 6
    for width in (390, 1280):
        tab.resize(width, 844)
        outside = tab.run(
            "[...document.querySelectorAll('.legend, .swatches, canvas, button, svg, h1')]"
            ".filter((part) => part.getBoundingClientRect().right > innerWidth)"
            ".map((part) => part.className || part.tagName)"
        )
        assert outside == []
        assert tab.run("document.documentElement.scrollWidth") <= width
    for dark in (True, False):
        tab.resize(1280, 900, dark=dark)
        tab.run("new Promise((done) => setTimeout(done, 500))")
        corner = drawn(tab)[10:20, 10:20]
        assert (corner < 40).all() if dark else (corner == 255).all()


def test_parts_open_by_links_pictures_by_clicks_and_nothing_comes_from_elsewhere(
    page: Path, tab: Browser
) -> None:
    tab.run("document.querySelector('.card a').click()")
    tab.wait_for("document.getElementById('words').open")
    tab.click("table.pictures img")
    first = "document.querySelectorAll('table.pictures img')"
    shown = f"document.querySelector('dialog img').src === {first}[{{}}].src"
    assert tab.run("document.querySelector('dialog').open") and tab.run(shown.format(0))
    tab.press("ArrowRight")
    assert tab.run(shown.format(1))
    tab.run("document.querySelector('dialog img').click()")
    assert not tab.run("document.querySelector('dialog').open")
    elsewhere = [url for url in tab.requests if not url.startswith(("data:", "blob:"))]
    assert set(elsewhere) <= {page.as_uri()}
    blocked = tab.run("fetch('http://127.0.0.1:1/').then(() => 'sent', (error) => error.message)")
    assert blocked != "sent"
    assert not any("127.0.0.1:1/" in url for url in tab.requests)


def test_without_webgl_there_is_a_picture(page: Path, tmp_path: Path) -> None:
    for tab in opened(page, tmp_path, "--disable-3d-apis"):
        place = "document.querySelector('#view3d {}').getBoundingClientRect().width"
        assert tab.run(place.format("img")) > 300
        assert tab.run(place.format("canvas")) == tab.run(place.format(".tools")) == 0
        assert "this is a picture" in tab.run("document.querySelector('.note').textContent")
