"""The page on random scenes shows what the code has."""

from scripts.page_marks import DOCS
from studies.pages import randomization


def test_the_tables_are_those_of_the_code() -> None:
    page = (DOCS / randomization.PAGE).read_text(encoding="utf-8")
    stale = [mark for mark, text in randomization.texts().items() if text.strip() not in page]
    assert stale == [], "run python -m studies page randomization"
