"""scripts/study_pages.py publishes what a case was, and not where its files lay."""

import json

import study_pages

from digs_warp.study.studies import camera
from reference.study_records import record_of


def test_no_path_of_this_machine_is_published() -> None:
    record = record_of(camera.cases(1)[0], 0)
    record["recording"] |= {"mesh": "/home/me/mug.glb", "environment": "/home/me/sky.hdr"}
    record["results"]["capture"] = "/home/me/out/captures/5307"
    published = study_pages.portable(record)
    assert "/home" not in json.dumps(published)
    assert published["recording"]["mesh"] == "mug.glb"
    assert published["results"] == record["results"] | {"capture": "5307"}


def test_a_failed_case_is_published_with_its_error() -> None:
    record = record_of(camera.cases(1)[0], 0) | {"error": "no model"}
    del record["results"]
    assert study_pages.portable(record)["error"] == "no model"
