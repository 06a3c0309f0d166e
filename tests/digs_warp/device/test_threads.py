import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from digs_warp.checks import DigsError
from digs_warp.device.threads import default_threads, limited_threads, over_items, over_rows


@pytest.mark.parametrize("threads", ["1", "3"])
def test_slices_cover_all_rows_once_and_results_keep_their_order(monkeypatch, threads: str):
    monkeypatch.setenv("DIGS_WARP_THREADS", threads)
    seen = np.zeros(1000, dtype=int)

    def work(rows: slice) -> int:
        seen[rows] += 1
        return rows.start

    assert over_rows(1000, work, chunk=7) == list(range(0, 1000, 7))
    assert (seen == 1).all()
    assert over_rows(0, work) == []


def test_an_error_is_handed_on_and_ends_the_work(monkeypatch):
    monkeypatch.setenv("DIGS_WARP_THREADS", "2")
    done: list[int] = []

    def work(rows: slice) -> None:
        if rows.start == 0:
            raise DigsError("row 0")
        time.sleep(0.002)  # so that it cannot all be done before the error is looked at
        done.append(rows.start)

    with pytest.raises(DigsError, match="row 0"):
        over_rows(5000, work, chunk=1)
    assert len(done) < 4999


def test_a_limit_holds_in_its_block_and_its_thread_only(monkeypatch):
    monkeypatch.setenv("DIGS_WARP_THREADS", "6")
    with limited_threads(4):
        with limited_threads(1):
            assert default_threads() == 1
        assert default_threads() == 4
        with ThreadPoolExecutor(1) as other:
            assert other.submit(default_threads).result() == 6
    with limited_threads(9):
        assert default_threads() == 6
    assert default_threads() == 6


@pytest.mark.parametrize("threads", ["1", "3"])
def test_items_keep_their_order_and_each_has_one_core(monkeypatch, threads: str):
    monkeypatch.setenv("DIGS_WARP_THREADS", threads)

    def work(item: int) -> tuple[int, int, set[int]]:
        inner = over_items([item, item], lambda each: threading.get_ident())
        assert set(inner) == {threading.get_ident()}  # nothing is left to share out
        blas = {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}
        return item, default_threads(), blas

    assert over_items(range(50), work) == [(number, 1, {1}) for number in range(50)]
    assert default_threads() == int(threads)
    assert over_items([], work) == []
