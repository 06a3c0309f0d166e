"""With --overwrite, the old result goes when the new one is complete."""

from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.commands.output import NewFolder, OutputFolder
from digs_warp.record.files import write_atomically
from digs_warp.record.layout import UNFINISHED
from digs_warp.record.run_log import RunLog
from reference.output_folders import names, our_folder, state


@pytest.mark.parametrize("kind", [OutputFolder, NewFolder])
def test_overwrite_replaces_our_files_and_keeps_others(
    kind: type[OutputFolder | NewFolder], tmp_path: Path
) -> None:
    folder = our_folder(tmp_path / "out")
    (folder / "notes.txt").write_text("precious")
    command = kind(out=folder, overwrite=True)
    with command.opened() as work:
        RunLog("simulate", {"frames": 4}).save(work / "run.json")
        write_atomically(work / "new.txt", b"new")
        assert names(folder)[-4:] == ["files.jsonl", "notes.txt", "old.txt", "run.json"]
    assert names(folder) == ["files.jsonl", "new.txt", "notes.txt", "run.json"]
    assert (folder / "notes.txt").read_text() == "precious"
    assert (folder / "new.txt").read_text() == "new"


@pytest.mark.parametrize("kind", [OutputFolder, NewFolder])
@pytest.mark.parametrize("error", [DigsError, KeyboardInterrupt])
def test_a_failure_keeps_the_old_result(
    kind: type[OutputFolder | NewFolder], error: type[BaseException], tmp_path: Path
) -> None:
    folder = our_folder(tmp_path / "out")
    before = {name: text for name, text in state(folder).items() if text != "folder"}
    with pytest.raises(error), kind(out=folder, overwrite=True).opened() as work:
        RunLog("simulate", {"frames": 4}).save(work / "run.json")
        write_atomically(work / "old.txt", b"new")
        raise error(f"'{work / 'old.txt'}': wrong")
    after = state(folder)
    assert before.items() <= after.items()
    assert (UNFINISHED in after) == (kind is OutputFolder)  # something to go on with


def test_an_error_names_the_folder_that_the_user_named(tmp_path: Path) -> None:
    folder = our_folder(tmp_path / "out")
    with pytest.raises(DigsError) as error:
        with OutputFolder(out=folder, overwrite=True).opened() as work:
            write_atomically(work / "half", b"half")
            raise DigsError(f"image '{work / 'a.png'}': broken.")
    assert str(error.value) == (
        f"image '{folder / 'a.png'}': broken. What was begun is in '{folder / UNFINISHED}'."
    )


def test_a_foreign_file_in_the_way_is_an_error_before_the_run(tmp_path: Path) -> None:
    folder = our_folder(tmp_path / "out")
    (folder / "images").mkdir()
    (folder / "images" / "0001.png").write_text("precious")
    before = state(tmp_path)
    with pytest.raises(DigsError, match=r"needs the names images/0001\.png"):
        with OutputFolder(out=folder, overwrite=True).opened(writes=["images/*.png"]):
            raise AssertionError
    assert state(tmp_path) == before


def test_resume_goes_on_with_an_interrupted_overwrite_and_says_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = our_folder(tmp_path / "out")
    with pytest.raises(KeyboardInterrupt):
        with OutputFolder(out=folder, overwrite=True).opened() as work:
            write_atomically(work / "half", b"half")
            raise KeyboardInterrupt
    with pytest.raises(DigsError, match="--resume"), OutputFolder(out=folder).opened():
        pass
    with caplog.at_level("INFO"), OutputFolder(out=folder, resume=True).opened() as work:
        assert (work / "half").read_bytes() == b"half"
        RunLog("simulate", {"frames": 4}).save(work / "run.json")
    assert "going on with the new result that --overwrite began" in caplog.text
    assert names(folder) == ["files.jsonl", "half", "run.json"]


def test_resume_never_takes_the_old_result_for_the_new_one(tmp_path: Path) -> None:
    """Interrupted before anything was made, with the settings of the old result."""
    folder = our_folder(tmp_path / "out")
    with pytest.raises(KeyboardInterrupt):
        with OutputFolder(out=folder, overwrite=True).opened():
            raise KeyboardInterrupt
    with OutputFolder(out=folder, resume=True).opened() as work:
        assert work != folder and not any(work.iterdir())
        RunLog("simulate", {"frames": 3}).save(work / "run.json")
        write_atomically(work / "new.txt", b"new")
    assert names(folder) == ["files.jsonl", "new.txt", "run.json"]
