"""A whole run as files, which the tests of the report share."""

from pathlib import Path

import pytest

from digs_warp.data.capture import Capture
from digs_warp.record.run_log import RunLog
from reference.report_folder import write_capture, write_reconstruction


@pytest.fixture
def run(tmp_path: Path) -> tuple[Capture, Path, Path]:
    """A whole run: (capture, reconstruction folder, where the report belongs)."""
    capture = write_capture(tmp_path / "capture")
    RunLog("simulate", {"mesh": None, "tier": "law"}, {"render": 9.5}).save(
        tmp_path / "capture/run.json"
    )
    write_reconstruction(tmp_path / "reconstruction", capture)
    seconds = {"simulate": 10.0, "reconstruct": 22.0, "export": 0.5}
    RunLog("run", {}, seconds).save(tmp_path / "run.json")
    return capture, tmp_path / "reconstruction", tmp_path / "report.html"
