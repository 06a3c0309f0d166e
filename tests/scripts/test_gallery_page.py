"""The gallery shows the examples of the code, each with its command, figures, picture and credit."""

import gallery_page
import pytest
from page_marks import DOCS

TEXT = (DOCS / gallery_page.PAGE).read_text(encoding="utf-8")


@pytest.mark.parametrize("example", gallery_page.EXAMPLES, ids=lambda each: each.name)
def test_an_example_is_on_the_page(example: gallery_page.Example) -> None:
    (section,) = (each for each in TEXT.split("## ")[1:] if each.startswith(f"{example.title}\n"))
    assert f"`digs-warp run {example.flags}`" in section
    assert f"({gallery_page.PICTURES}/{example.name}.jpg)" in section
    assert " Gaussians, PSNR " in section
    assert example.credit in section
    assert ("DATA" in example.flags) == bool(example.credit)


def test_there_are_no_other_pictures() -> None:
    pictures = {path.stem for path in (DOCS / gallery_page.PICTURES).iterdir()}
    assert pictures == {example.name for example in gallery_page.EXAMPLES}
