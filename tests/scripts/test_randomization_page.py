"""The page on random scenes shows what the code has."""

import randomization_page
from page_marks import DOCS


def test_the_tables_are_those_of_the_code() -> None:
    page = (DOCS / randomization_page.PAGE).read_text(encoding="utf-8")
    stale = [mark for mark, text in randomization_page.texts().items() if text.strip() not in page]
    assert stale == [], "run python scripts/randomization_page.py"
