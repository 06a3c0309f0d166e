"""Which output folders may be written: checks come before anything is made, of whole commands, too."""

import signal
from pathlib import Path

import numpy as np
import pytest

import digs_warp
from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.commands import output
from digs_warp.commands.output import OutputFolder, is_ours
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.record.files import write_atomically
from digs_warp.record.layout import GAUSSIANS, UNFINISHED
from digs_warp.record.run_log import RunLog
from reference.output_folders import SMALL, names, our_folder, state, write
from reference.tiny_capture import write_tiny_capture
from reference.trained_ball import train_until


def test_a_new_and_an_empty_folder_are_fine(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("empty", "new"):
        write(OutputFolder(out=tmp_path / name))
        assert names(tmp_path / name) == ["files.jsonl", "new.txt", "run.json"]


def test_a_folder_in_use_is_refused_and_left_alone(tmp_path: Path, capsys) -> None:
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


def test_overwrite_refuses_to_delete_its_own_input_and_the_working_directory(
    tmp_path: Path, capsys, monkeypatch
) -> None:
    folder = our_folder(tmp_path / "out")
    mesh = folder / "object.glb"
    mesh.write_text("the user's mesh")
    before = state(tmp_path)
    arguments = ["simulate", "--out", str(folder), "--overwrite"]
    assert main([*arguments, "--mesh", str(mesh)]) == EXIT_BAD_INPUT
    assert f"--overwrite would delete '{mesh}'" in capsys.readouterr().err
    monkeypatch.chdir(folder)
    assert main(arguments) == EXIT_BAD_INPUT
    assert state(tmp_path) == before


def test_a_file_is_no_output_folder(tmp_path: Path, capsys) -> None:
    for name in ["file", "file/out"]:
        (tmp_path / "file").write_text("")
        assert main(["simulate", "--out", str(tmp_path / name), "--overwrite"]) == EXIT_BAD_INPUT
        assert "file" in capsys.readouterr().err
        assert names(tmp_path) == ["file"]


def test_a_file_is_not_replaced_by_what_is_made_from_it(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("v 0 0 0")
    arguments = ["plan", "--mesh", str(mesh), "--json", str(mesh), "--overwrite"]
    assert main(arguments) == EXIT_BAD_INPUT
    assert mesh.read_text() == "v 0 0 0"


def test_a_link_among_the_devices_is_not_replaced(tmp_path: Path, monkeypatch) -> None:
    """Where stdout goes to a file, /dev/stdout leads to a file; the system needs the link."""
    monkeypatch.setattr(output, "DEVICES", tmp_path)
    (tmp_path / "log").write_text("")
    (tmp_path / "stdout").symlink_to(tmp_path / "log")
    with pytest.raises(DigsError, match="name a new file"):
        output.check_output_file(tmp_path / "stdout", overwrite=True)


# With --overwrite, the old result goes when the new one is complete.


def test_overwrite_replaces_our_files_and_keeps_others(tmp_path: Path) -> None:
    folder = our_folder(tmp_path / "out")
    (folder / "notes.txt").write_text("precious")
    with OutputFolder(out=folder, overwrite=True).opened() as work:
        RunLog("simulate", {"frames": 4}).save(work / "run.json")
        write_atomically(work / "new.txt", b"new")
        assert names(folder)[-4:] == ["files.jsonl", "notes.txt", "old.txt", "run.json"]
    assert names(folder) == ["files.jsonl", "new.txt", "notes.txt", "run.json"]
    assert (folder / "notes.txt").read_text() == "precious"
    assert (folder / "new.txt").read_text() == "new"


@pytest.mark.parametrize("can_resume", [True, False])
@pytest.mark.parametrize("error", [DigsError, KeyboardInterrupt])
def test_a_failure_keeps_the_old_result(
    can_resume: bool, error: type[BaseException], tmp_path: Path
) -> None:
    output = OutputFolder(out=tmp_path / "out", overwrite=True)
    folder = our_folder(tmp_path / "out")
    before = {name: text for name, text in state(folder).items() if text != "folder"}
    with pytest.raises(error) as told, output.opened(can_resume=can_resume) as work:
        RunLog("simulate", {"frames": 4}).save(work / "run.json")
        write_atomically(work / "old.txt", b"new")
        raise error(f"'{work / 'old.txt'}': wrong.")
    if error is DigsError:  # it names the folder that the user named
        kept = f" What was begun is in '{folder / UNFINISHED}'." if can_resume else ""
        assert str(told.value) == f"'{folder / 'old.txt'}': wrong.{kept}"
    after = state(folder)
    assert before.items() <= after.items()
    assert (UNFINISHED in after) == can_resume  # something to go on with


def test_resume_goes_on_with_an_interrupted_overwrite_and_says_so(tmp_path: Path, caplog) -> None:
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


SHORT = "--iterations 2 --sh-degree 0 --voxel-size 0.05".split()


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_capture(tmp_path_factory.mktemp("tiny") / "capture", frames=8).folder


def test_a_recording_that_cannot_be_made_changes_nothing(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("README.txt").write_text("no mesh")
    our_folder(tmp_path / "used")
    before = state(tmp_path)
    for flags in [
        ["--effects", "nosuch", "--tier", "guided"],
        ["--environment", "missing.hdr"],
        ["--mesh", "README.txt"],
        ["--profile", "no-such-camera"],
        ["--meshes", "no/such/*.glb"],
    ]:
        for command in ("simulate", "run"):
            if command == "run" and "--meshes" in flags:
                continue
            assert main([command, "--out", "used", "--overwrite", *SMALL, *flags]) == EXIT_BAD_INPUT
            assert main([command, "--out", "new/folder", *SMALL, *flags]) == EXIT_BAD_INPUT
        assert state(tmp_path) == before


def test_a_reconstruction_that_cannot_be_made_changes_nothing(
    capture: Path, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    our_folder(tmp_path / "used", "reconstruct")
    before = state(tmp_path)
    for flags in [
        ["--mask-folder", "empty", "--masks", "folder"],
        ["--device", "cuda:7"],
        ["--voxel-size", "1e-9"],
        ["--test-every", "1"],
    ]:
        arguments = ["reconstruct", str(capture), *SHORT, *flags]
        assert main([*arguments, "--out", "used", "--overwrite"]) != EXIT_OK
        assert main([*arguments, "--out", "new/folder"]) != EXIT_OK
        assert state(tmp_path) == before


def test_an_overwrite_that_is_terminated_resumes_to_the_same_bits(
    capture: Path, tmp_path: Path
) -> None:
    """A real SIGTERM in the middle of the training; until the end the old result is as it was."""
    out, alone = tmp_path / "out", tmp_path / "alone"
    options = "--iterations 300 --sh-degree 0 --voxel-size 0.02".split()
    assert main(["reconstruct", str(capture), "--out", str(alone), *options]) == 0
    assert main(["reconstruct", str(capture), "--out", str(out), *SHORT]) == 0
    (out / "notes.txt").write_text("precious")
    before = state(out)
    arguments = ["reconstruct", str(capture), "--out", str(out), *options]
    ended = train_until(signal.SIGTERM, [*arguments, "--overwrite"])
    assert ended.returncode == 143 and "--resume" in ended.stderr
    assert before.items() <= state(out).items()
    assert main([*arguments, "--resume"]) == 0
    one, other = (Gaussians.load(folder / GAUSSIANS) for folder in (out, alone))
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert names(out) == sorted([*names(alone), "notes.txt"])


def test_the_functions_of_the_package_replace_no_file_of_others(
    capture: Path, tmp_path: Path
) -> None:
    (tmp_path / "masks").mkdir()
    (tmp_path / "masks/0001.png").write_text("precious")
    with pytest.raises(DigsError, match="not empty"):
        digs_warp.reconstruct(capture, out=tmp_path, iterations=2, masks="depth")
    with pytest.raises(DigsError, match="not empty"):
        digs_warp.simulate(out=tmp_path, frames=2, width=32, height=18)
    assert names(tmp_path) == ["masks"]
