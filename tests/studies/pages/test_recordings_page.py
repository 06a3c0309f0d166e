"""The page on real recordings shows what the code has, and only pictures that may be shown."""

import numpy as np

from scripts.page_marks import DOCS
from studies.pages import real_recordings
from studies.real_recordings import RECORDINGS

PAGE = DOCS / "recordings.md"


def test_the_list_is_that_of_the_code() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert real_recordings.described(RECORDINGS) in text, (
        "run python -m studies page real-recordings"
    )


def test_only_pictures_that_a_license_allows_are_here_and_credited() -> None:
    text = PAGE.read_text(encoding="utf-8")
    pictures = {path.stem: path for path in (DOCS / real_recordings.PICTURES).iterdir()}
    allowed = {each.name: each.credit for each in RECORDINGS if each.pictures_allowed}
    assert pictures.keys() <= allowed.keys()
    for name, path in pictures.items():
        assert f"({real_recordings.PICTURES}/{path.name})\n\n*Images: {allowed[name]}.*" in text
        assert path.stat().st_size <= real_recordings.LARGEST


def test_a_picture_without_any_order_becomes_small_enough() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (720, 960, 3), dtype=np.uint8)
    assert len(real_recordings.small_jpeg(noise)) <= real_recordings.LARGEST
