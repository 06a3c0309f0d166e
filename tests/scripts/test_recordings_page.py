"""The page on real recordings shows what the code has, and only pictures that may be shown."""

import numpy as np
import recordings_page
from page_marks import DOCS

from digs_warp.study.benchmarks import find_benchmark
from digs_warp.study.real_recordings import RECORDINGS

PAGE = DOCS / find_benchmark("recordings").page


def test_the_list_is_that_of_the_code() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert recordings_page.described(RECORDINGS) in text, "run python scripts/recordings_page.py"


def test_only_pictures_that_a_license_allows_are_here_and_credited() -> None:
    text = PAGE.read_text(encoding="utf-8")
    pictures = {path.stem: path for path in (DOCS / recordings_page.PICTURES).iterdir()}
    allowed = {each.name: each.credit for each in RECORDINGS if each.pictures_allowed}
    assert pictures.keys() <= allowed.keys()
    for name, path in pictures.items():
        assert f"({recordings_page.PICTURES}/{path.name})\n\n*Images: {allowed[name]}.*" in text
        assert path.stat().st_size <= recordings_page.LARGEST


def test_a_picture_without_any_order_becomes_small_enough() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (720, 960, 3), dtype=np.uint8)
    assert len(recordings_page.small_jpeg(noise)) <= recordings_page.LARGEST
