"""The plan for many scenes: by laws that are fitted to the published study, and bytes of a real sample."""

from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_OK, main
from digs_warp.study.engine.store import Store
from digs_warp.study.many_plan import predict, seconds_of
from digs_warp.study.recommend.published import PUBLISHED
from digs_warp.study.studies.scaling import ONE_THREAD, load_of

SMALL = "--frames 8 --width 64 --height 48 --splats 2000 --iterations 100".split()


def test_what_was_measured_on_one_thread_is_predicted() -> None:
    records = Store(PUBLISHED / "scaling").finished()
    (single,) = [record for record in records if record["labels"]["curve"] == ONE_THREAD]
    found = predict(records, load_of(single))
    # The laws miss the base case, too.
    assert found.record == pytest.approx(seconds_of(single, "record"), rel=0.4)
    assert found.reconstruct == pytest.approx(seconds_of(single, "reconstruct"), rel=0.4)
    assert 500 < found.memory < 1500


def test_a_study_without_the_case_on_one_thread_is_refused() -> None:
    records = [
        r for r in Store(PUBLISHED / "scaling").finished() if r["labels"]["curve"] != ONE_THREAD
    ]
    with pytest.raises(DigsError, match="no base case on one thread"):
        predict(records, load_of(records[0]))


def test_the_plan_multiplies(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = ["study", "plan", *SMALL, "--price", "0.05", "--cores", "10"]
    assert main([*command, "--scenes", "10000"]) == EXIT_OK
    facts = dict(line.split(None, 1) for line in capsys.readouterr().out.splitlines())
    assert "10,000 of 8 frames of 64 x 48" in facts["scenes"]
    core_hours = float(facts["core"].rpartition(":")[2].replace(",", ""))
    assert float(facts["cost"].split()[0].replace(",", "")) == pytest.approx(
        0.05 * core_hours, abs=1
    )
    assert float(facts["hours"].split()[0].replace(",", "")) == pytest.approx(
        core_hours / 10, abs=0.1
    )
    main(["study", "plan", *SMALL, "--price", "1", "--study", str(tmp_path)])
    assert "measure one first" in capsys.readouterr().err
