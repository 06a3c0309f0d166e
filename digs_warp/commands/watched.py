"""`--view`: a page in the browser that shows a training while it runs."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from digs_warp.train.session import Watch


@contextmanager
def watched_training(view: bool) -> "Iterator[Watch | None]":
    """Yield what the training calls every few iterations; None without ``view``."""
    if not view:
        yield None
        return
    from digs_warp.show.view.live import live_page

    with live_page(_say) as watch:
        yield watch


def _say(address: str) -> None:
    sys.stderr.write(f"the training, until it ends: {address}\n")
    sys.stderr.flush()
