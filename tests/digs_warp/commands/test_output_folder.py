"""Which output folders may be written: checks come before anything is made."""

from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_BAD_INPUT, main
from digs_warp.commands import output
from digs_warp.commands.output import NewFolder, OutputFolder, is_ours
from digs_warp.record.run_log import RunLog
from reference.output_folders import SMALL, names, our_folder, state, write


def test_a_new_and_an_empty_folder_are_fine(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for kind in (OutputFolder, NewFolder):
        for name in ("empty", "new"):
            out = tmp_path / kind.__name__ / name
            write(kind(out=out))
            assert names(out) == ["files.jsonl", "new.txt", "run.json"]


def test_a_folder_in_use_is_refused_and_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = our_folder(tmp_path / "out")
    before = state(tmp_path)
    assert main(["simulate", "--out", str(folder)]) == EXIT_BAD_INPUT
    message = capsys.readouterr().err
    assert str(folder) in message
    assert "--resume" in message
    assert "--overwrite" in message
    assert state(tmp_path) == before


def test_a_run_that_failed_at_once_leaves_nothing(tmp_path: Path) -> None:
    """The corrected command needs no flag."""
    out = tmp_path / "a" / "out"
    with pytest.raises(DigsError, match="wrong"), OutputFolder(out=out).opened() as work:
        RunLog("run", {"frames": 3}).save(work / "run.json")
        RunLog("simulate", {"frames": 3}).save(work / "capture" / "run.json")
        raise DigsError("wrong")
    assert names(tmp_path) == []


def test_a_record_alone_is_no_result(tmp_path: Path) -> None:
    record = tmp_path / "run.json"
    RunLog("run", {"frames": 3}).save(record)
    write(OutputFolder(out=tmp_path))
    (tmp_path / "new.txt").unlink()
    record.write_text("{}")  # somebody else's
    with pytest.raises(DigsError, match="not empty"), OutputFolder(out=tmp_path).opened():
        pass
    assert record.read_text() == "{}"


def test_resume_keeps_what_is_there(tmp_path: Path) -> None:
    folder = our_folder(tmp_path / "out")
    with OutputFolder(out=folder, resume=True).opened() as work:
        assert work == folder
    assert (folder / "old.txt").exists()


def test_a_failed_resume_leaves_a_foreign_record(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("{}")
    assert main(["simulate", "--out", str(tmp_path), "--resume"]) == EXIT_BAD_INPUT
    assert (tmp_path / "run.json").read_text() == "{}"


def test_overwrite_refuses_a_folder_that_we_did_not_write(tmp_path: Path) -> None:
    for name, record in [
        ("run.json", None),
        ("transforms.json", ""),
        ("run.json", "{"),
        ("transforms.json", "[]"),
        ("run.json", '{"command": "train"}'),
        ("transforms.json", '{"frames": [], "h": 3}'),
    ]:
        (tmp_path / "photo.jpg").write_text("precious")
        if record is not None:
            (tmp_path / name).write_text(record)
        assert not is_ours(tmp_path)
        before = state(tmp_path)
        assert main(["simulate", "--out", str(tmp_path), "--overwrite"]) == EXIT_BAD_INPUT
        assert state(tmp_path) == before


def test_overwrite_refuses_a_folder_without_a_list_of_its_files(tmp_path: Path) -> None:
    folder = our_folder(tmp_path / "out")
    (folder / "files.jsonl").unlink()
    with pytest.raises(DigsError, match="an earlier version wrote this folder"):
        write(OutputFolder(out=folder, overwrite=True))
    assert names(folder) == ["old.txt", "run.json"]


def test_overwrite_refuses_to_delete_its_own_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = our_folder(tmp_path / "out")
    mesh = folder / "object.glb"
    mesh.write_text("the user's mesh")
    before = state(tmp_path)
    arguments = ["simulate", "--mesh", str(mesh), "--out", str(folder), "--overwrite"]
    assert main(arguments) == EXIT_BAD_INPUT
    assert f"--overwrite would delete '{mesh}'" in capsys.readouterr().err
    assert state(tmp_path) == before


def test_overwrite_refuses_to_delete_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = our_folder(tmp_path / "out")
    monkeypatch.chdir(folder)
    assert main(["simulate", "--out", str(folder), "--overwrite"]) == EXIT_BAD_INPUT
    assert (folder / "old.txt").exists()


def test_a_file_is_no_output_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ["file", "file/out"]:
        (tmp_path / "file").write_text("")
        assert main(["simulate", "--out", str(tmp_path / name), "--overwrite"]) == EXIT_BAD_INPUT
        assert "file" in capsys.readouterr().err
        assert names(tmp_path) == ["file"]


def test_a_link_that_leads_to_no_folder_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("precious")
    for link, target in (("dangling", "gone"), ("loop", "loop"), ("to-file", "file")):
        (tmp_path / link).symlink_to(tmp_path / target)
    for name in ("dangling", "loop", "to-file", "dangling/below"):
        out = tmp_path / name
        for command in (["simulate", *SMALL], ["plan", "--frames", "1", "--json"]):
            flag = "--json" if "--json" in command else "--out"
            if (flag, name) == ("--json", "to-file"):
                continue
            words = [*command, *(["--out"] if flag == "--out" else []), str(out)]
            assert main(words) == EXIT_BAD_INPUT
            error = capsys.readouterr().err
            assert f"{flag} '{out}': " in error and " a link to " in error
        assert (tmp_path / "file").read_text() == "precious"
        assert not (tmp_path / "gone").exists()


def test_a_link_to_a_folder_is_that_folder(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    for overwrite in (False, True):
        write(OutputFolder(out=tmp_path / "link", overwrite=overwrite))
        assert (tmp_path / "real/new.txt").is_file() and (tmp_path / "link").is_symlink()


def test_a_file_is_not_replaced_by_what_is_made_from_it(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("v 0 0 0")
    arguments = ["plan", "--mesh", str(mesh), "--json", str(mesh), "--overwrite"]
    assert main(arguments) == EXIT_BAD_INPUT
    assert mesh.read_text() == "v 0 0 0"


def test_a_link_among_the_devices_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where stdout goes to a file, /dev/stdout leads to a file; the system needs the link."""
    monkeypatch.setattr(output, "DEVICES", tmp_path)
    (tmp_path / "log").write_text("")
    (tmp_path / "stdout").symlink_to(tmp_path / "log")
    with pytest.raises(DigsError, match="name a new file"):
        output.check_output_file(tmp_path / "stdout", overwrite=True)
