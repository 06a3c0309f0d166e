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
from digs_warp.show.report.view3d.start import FOV_DEG
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


def drawn(tab: Browser) -> np.ndarray:
    """The pixels of the view at full detail."""
    tab.run(f"{CANVAS}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
    tab.wait_for(f"{CANVAS}.dataset.detail === '1'")
    tab.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    box = tab.run(f"JSON.parse(JSON.stringify({CANVAS}.getBoundingClientRect()))")
    x, y, width, height = (round(box[name]) for name in ("x", "y", "width", "height"))
    shown, before = tab.screenshot(), None
    # A busy machine may be a frame behind.
    while before is None or not np.array_equal(shown, before):
        shown, before = tab.screenshot(), shown
    return shown[y : y + height, x : x + width]


def press(tab: Browser, key: str, times: int) -> None:
    tab.run(f"{CANVAS}.focus()")
    for _ in range(times):
        tab.press(key)


def by_engine(page: Path, picture: np.ndarray, turned_deg: float = 0.0) -> np.ndarray:
    """What our rasterizer draws from where the view begins, turned around the vertical."""
    result = Reconstruction.load(page.parent / "reconstruction")
    assert result.frames is not None
    first = first_view(result, result.frames)
    angle = np.deg2rad(turned_deg)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    eye = first.target + turn @ (first.camera.center_world - first.target)
    height, width = picture.shape[:2]
    smaller = first.camera.intrinsics.height / first.camera.intrinsics.fy
    focal = min(width, height) / smaller
    k = Intrinsics(width, height, focal, focal, width / 2, height / 2)
    camera = Camera(k, look_at(eye, first.target, UP))
    return to_uint8(render(result.gaussians, camera, background=(1.0, 1.0, 1.0)).image)


def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(a.astype(int) - b.astype(int))[3:-3, 3:-3]


def test_the_view_draws_what_the_engine_draws(page: Path, tab: Browser) -> None:
    assert FOV_DEG == 45
    tab.wait_for(f"{CANVAS}.dataset.drawn")
    press(tab, "0", 1)
    first = drawn(tab)
    assert first.shape[1] > 400 and (first.min(axis=2) < 200).mean() > 0.2
    assert difference(first, by_engine(page, first)).mean() < 1.5
    press(tab, "ArrowRight", 8)
    turned = drawn(tab)
    assert difference(turned, first).mean() > 10
    assert difference(turned, by_engine(page, turned, turned_deg=40)).mean() < 1.5


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


def test_drags_keys_and_buttons_move_the_view_and_0_goes_back(tab: Browser) -> None:
    press(tab, "0", 1)
    first = drawn(tab)

    def covered(picture: np.ndarray) -> float:
        return float((picture.min(axis=2) < 240).mean())

    press(tab, "+", 3)
    assert covered(drawn(tab)) > 1.3 * covered(first)
    press(tab, "0", 1)
    assert difference(drawn(tab), first).max() == 0
    tab.click("#view3d button[data-key='-']")
    assert covered(drawn(tab)) < 0.9 * covered(first)
    tab.click("#view3d button[data-key='0']")
    assert difference(drawn(tab), first).max() == 0
    box = tab.run(f"JSON.parse(JSON.stringify({CANVAS}.getBoundingClientRect()))")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.drag((x, y), (x + 60, y + 20))
    assert difference(drawn(tab), first).mean() > 5
    press(tab, "0", 1)
    assert difference(drawn(tab), first).max() == 0


def test_one_finger_turns_and_two_zoom_and_move(page: Path, tab: Browser) -> None:
    press(tab, "0", 1)
    first = drawn(tab)
    box = tab.run(f"JSON.parse(JSON.stringify({CANVAS}.getBoundingClientRect()))")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    side = min(box["width"], box["height"])
    scrolled = tab.run("scrollY")

    # A drag across the whole view is 216 degrees: 40 degrees to the right.
    across = side * 40 / 216
    tab.touch([(x, y)], [(x - across / 2, y)], [(x - across, y)])
    turned = drawn(tab)
    assert difference(turned, by_engine(page, turned, turned_deg=40)).mean() < 1.5
    press(tab, "0", 1)

    def extent(picture: np.ndarray) -> tuple[float, float]:
        """The width of what is seen, and its middle [px]."""
        inside = picture[3:-3, 3:-3]  # without the outline
        seen = np.flatnonzero((inside.min(axis=2) < 240).any(axis=0))
        return float(np.ptp(seen)), float(seen.mean())

    width, middle = extent(first)
    tab.touch([(x - 45, y), (x + 45, y)], [(x - 36, y), (x + 36, y)], [(x - 30, y), (x + 30, y)])
    assert extent(drawn(tab))[0] == pytest.approx(width / 1.5, rel=0.1)
    press(tab, "0", 1)
    tab.touch([(x - 30, y), (x + 30, y)], [(x, y), (x + 60, y)])
    assert extent(drawn(tab))[1] == pytest.approx(middle + 30, abs=8)
    press(tab, "0", 1)
    # Fingers that were lifted are forgotten, and the page under them has not scrolled.
    assert difference(drawn(tab), first).max() == 0
    assert tab.run("scrollY") == scrolled


def test_cameras_are_drawn_with_a_legend_that_tells_them_by_shape(tab: Browser) -> None:
    legend = "getComputedStyle(document.querySelector('#view3d .swatches')).display"
    assert tab.run(legend) == "none"
    tab.click("#view3d input")
    r, _, b = np.moveaxis(drawn(tab).astype(int), -1, 0)
    assert np.count_nonzero(b - r > 90) > 200  # training
    assert np.count_nonzero(r - b > 120) > 200  # held out
    assert tab.run(legend) == "flex"
    assert "with a cross" in tab.run("document.querySelector('#view3d .swatches').textContent")
    tab.click("#view3d input")
    assert tab.run(legend) == "none"


def test_a_click_on_a_camera_shows_what_it_saw(page: Path, tab: Browser) -> None:
    result = Reconstruction.load(page.parent / "reconstruction")
    assert result.frames is not None
    first = first_view(result, result.frames)
    tab.click("#view3d input")
    drawn(tab)
    box = tab.run(f"JSON.parse(JSON.stringify({CANVAS}.getBoundingClientRect()))")
    # The camera that stands nearest to the eye is not hidden by others.
    eyes = [frame.camera.center_world for frame, _ in result.frames.by_time]
    far = first.target + 3.0 * (first.camera.center_world - first.target)
    chosen = result.frames.by_time[int(np.argmin([np.linalg.norm(eye - far) for eye in eyes]))][0]
    zoom = tab.run(
        "JSON.parse(document.getElementById('view3d-about').textContent).contents[0].cameras.zoom"
    )
    eye = first.target + zoom * (first.camera.center_world - first.target)
    k = first.camera.intrinsics
    focal = min(box["width"], box["height"]) * k.fy / k.height
    seen = Camera(Intrinsics(1, 1, focal, focal, 0.0, 0.0), look_at(eye, first.target, UP))
    ((x, y),), _ = seen.project(chosen.camera.center_world[None])
    place = (box["x"] + box["width"] / 2 + x, box["y"] + box["height"] / 2 + y)
    tab.drag(place, place)
    found = drawn(tab)
    assert not tab.run("document.querySelector('#view3d input').checked")
    k = chosen.camera.intrinsics
    height, width = found.shape[:2]
    focal = min(width / k.width, height / k.height) * k.fx
    as_seen = Intrinsics(width, height, focal, focal, width / 2, height / 2)
    camera = Camera(as_seen, chosen.camera.world_from_cam)
    theirs = to_uint8(render(result.gaussians, camera, background=(1.0, 1.0, 1.0)).image)
    assert difference(found, theirs).mean() < 1.5
    press(tab, "0", 1)


def test_the_page_answers_in_sight_is_short_and_prints_on_few_pages(tab: Browser) -> None:
    bottom = "document.querySelector('.cards').getBoundingClientRect().bottom + scrollY"
    tab.resize(1280, 800)
    try:
        assert tab.run(bottom) <= 800
        assert tab.run(f"{CANVAS}.getBoundingClientRect().top + scrollY") < 200
        assert tab.run("document.documentElement.scrollHeight") <= 5000
        assert tab.run("[...document.images].every((image) => image.complete)")
        pdf = base64.b64decode(tab._call("Page.printToPDF")["data"])
        assert pdf.count(b"/Type /Page") - pdf.count(b"/Type /Pages") <= 6
    finally:
        tab.resize(1280, 900)


def test_a_dark_page_has_a_dark_view(tab: Browser) -> None:
    press(tab, "0", 1)
    assert (drawn(tab)[10:20, 10:20] == 255).all()
    tab.resize(1280, 900, dark=True)
    try:
        tab.run("new Promise((done) => setTimeout(done, 500))")
        assert (drawn(tab)[10:20, 10:20] < 40).all()
    finally:
        tab.resize(1280, 900)
        tab.run("new Promise((done) => setTimeout(done, 500))")


def test_parts_open_by_links_and_pictures_by_clicks(tab: Browser) -> None:
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


def test_nothing_comes_from_elsewhere(page: Path, tab: Browser) -> None:
    elsewhere = [url for url in tab.requests if not url.startswith(("data:", "blob:"))]
    assert set(elsewhere) <= {page.as_uri()}
    blocked = tab.run("fetch('http://127.0.0.1:1/').then(() => 'sent', (error) => error.message)")
    assert blocked != "sent"
    assert not any("127.0.0.1:1/" in url for url in tab.requests)


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_sticks_out_at_any_width(tab: Browser, width: int) -> None:
    tab.resize(width, 844)
    try:
        outside = tab.run(
            "[...document.querySelectorAll('.legend, .swatches, canvas, button, svg, h1')]"
            ".filter((part) => part.getBoundingClientRect().right > innerWidth)"
            ".map((part) => part.className || part.tagName)"
        )
        assert outside == []
        assert tab.run("document.documentElement.scrollWidth") <= width
    finally:
        tab.resize(1280, 900)


def test_without_webgl_there_is_a_picture(page: Path, tmp_path: Path) -> None:
    for tab in opened(page, tmp_path, "--disable-3d-apis"):
        place = "document.querySelector('#view3d {}').getBoundingClientRect().width"
        assert tab.run(place.format("img")) > 300
        assert tab.run(place.format("canvas")) == tab.run(place.format(".tools")) == 0
        assert "this is a picture" in tab.run("document.querySelector('.note').textContent")
