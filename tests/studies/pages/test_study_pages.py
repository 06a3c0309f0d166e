"""What is published of a case: what it was, and not where its files lay."""

import json

import pytest

from digs_warp.study.catalogue import find_study
from reference.study_records import record_of
from studies.pages.published import portable


@pytest.mark.parametrize("failed", [False, True])
def test_no_path_of_this_machine_is_published(failed: bool) -> None:
    record = record_of(find_study("robustness").cases(1, 1, 300)[0], 0)
    record["recording"] |= {"mesh": "/home/me/mug.glb", "environment": "/home/me/sky.hdr"}
    record["results"]["capture"] = "/home/me/out/captures/5307"
    if failed:
        del record["results"]
        record["error"] = "no model"
    published = portable(record)
    assert "/home" not in json.dumps(published)
    assert published["recording"]["mesh"] == "mug.glb"
    assert published.get("error") == record.get("error")
    if not failed:
        assert published["results"] == record["results"] | {"capture": "5307"}
