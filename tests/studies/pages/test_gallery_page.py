"""The gallery shows the examples of the code, each with its command, figures, picture and credit."""

import pytest

from scripts.page_marks import DOCS
from studies.pages import gallery

TEXT = (DOCS / gallery.PAGE).read_text(encoding="utf-8")


@pytest.mark.parametrize("example", gallery.EXAMPLES, ids=lambda each: each.name)
def test_an_example_is_on_the_page(example: gallery.Example) -> None:
    (section,) = (each for each in TEXT.split("## ")[1:] if each.startswith(f"{example.title}\n"))
    assert f"`digs-warp run {example.flags}`" in section
    assert f"({gallery.PICTURES}/{example.name}.jpg)" in section
    assert " Gaussians, PSNR " in section
    assert example.credit in section
    assert ("DATA" in example.flags) == bool(example.credit)


def test_there_are_no_other_pictures() -> None:
    pictures = {path.stem for path in (DOCS / gallery.PICTURES).iterdir()}
    assert pictures == {example.name for example in gallery.EXAMPLES}
