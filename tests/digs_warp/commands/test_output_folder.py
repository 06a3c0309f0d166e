"""The rules that protect an output folder: checks come first, and the old result stays as long as needed."""

import hashlib
import signal
from pathlib import Path

import numpy as np
import pytest

import digs_warp
from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.commands.output import NewFolder, OutputFolder, is_ours
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.record.files import write_atomically
from digs_warp.record.layout import GAUSSIANS, UNFINISHED
from digs_warp.record.manifest import recorded_files
from digs_warp.record.run_log import RunLog
from reference.interrupted_training import train_until
from reference.tiny_capture import write_tiny_capture

SMALL = "--frames 2 --width 32 --height 18 --samples-per-pixel 1 --tier truth".split()
SHORT = "--iterations 2 --sh-degree 0 --voxel-size 0.05".split()


def our_folder(path: Path, command: str = "simulate") -> Path:
    """A folder as an earlier run left it."""
    with recorded_files(path):
        RunLog(command, {"frames": 3}).save(path / "run.json")
        write_atomically(path / "old.txt", b"from an earlier run")
    return path


def state(folder: Path) -> dict[str, str]:
    """Every file and folder below ``folder``, with the bytes and the time of each file."""
    return {
        str(path.relative_to(folder)): f"{path.stat().st_mtime_ns} "
        + hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else "folder"
        for path in folder.rglob("*")
    }


def write(folder: OutputFolder | NewFolder, name: str = "new.txt", text: str = "new") -> None:
    with folder.opened() as work:
        RunLog("simulate", {"frames": 4}).save(work / "run.json")
        write_atomically(work / name, text.encode())


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# Which folders may be written


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


@pytest.mark.parametrize(
    "record", [None, "", "{", "[]", '{"command": "train"}', '{"frames": [], "h": 3}']
)
@pytest.mark.parametrize("name", ["run.json", "transforms.json"])
def test_overwrite_refuses_a_folder_that_we_did_not_write(
    record: str | None, name: str, tmp_path: Path
) -> None:
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
    assert str(mesh) in capsys.readouterr().err
    assert state(tmp_path) == before


def test_overwrite_refuses_to_delete_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = our_folder(tmp_path / "out")
    monkeypatch.chdir(folder)
    assert main(["simulate", "--out", str(folder), "--overwrite"]) == EXIT_BAD_INPUT
    assert (folder / "old.txt").exists()


@pytest.mark.parametrize("name", ["file", "file/out"])
def test_a_file_is_no_output_folder(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(["simulate", "--out", str(tmp_path / name), "--overwrite"]) == EXIT_BAD_INPUT
    assert "file" in capsys.readouterr().err
    assert names(tmp_path) == ["file"]


# --overwrite: the old result goes when the new one is complete


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


# The same with whole commands


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_capture(tmp_path_factory.mktemp("tiny") / "capture", frames=8).folder


@pytest.mark.parametrize(
    "flags",
    [
        ["--effects", "nosuch", "--tier", "guided"],
        ["--environment", "missing.hdr"],
        ["--mesh", "README.txt"],
        ["--profile", "no-such-camera"],
        ["--meshes", "no/such/*.glb"],
    ],
)
def test_a_recording_that_cannot_be_made_changes_nothing(
    flags: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("README.txt").write_text("no mesh")
    our_folder(tmp_path / "used")
    before = state(tmp_path)
    for command in ("simulate", "run"):
        if command == "run" and "--meshes" in flags:
            continue
        assert main([command, "--out", "used", "--overwrite", *SMALL, *flags]) == EXIT_BAD_INPUT
        assert main([command, "--out", "new/folder", *SMALL, *flags]) == EXIT_BAD_INPUT
    assert state(tmp_path) == before


@pytest.mark.parametrize(
    "flags",
    [
        ["--mask-folder", "empty", "--masks", "folder"],
        ["--masks", "isnet", "--mask-model", "missing.onnx"],
        ["--device", "cuda:7"],
        ["--voxel-size", "1e-9"],
        ["--test-every", "1"],
    ],
)
def test_a_reconstruction_that_cannot_be_made_changes_nothing(
    flags: list[str], capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    our_folder(tmp_path / "used", "reconstruct")
    before = state(tmp_path)
    arguments = ["reconstruct", str(capture), *SHORT, *flags]
    assert main([*arguments, "--out", "used", "--overwrite"]) != EXIT_OK
    assert main([*arguments, "--out", "new/folder"]) != EXIT_OK
    assert state(tmp_path) == before


def test_a_data_set_with_a_failed_scene_replaces_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    our_folder(tmp_path / "out")
    before = state(tmp_path / "out")
    Path("a.obj").write_text("no mesh")
    arguments = ["simulate", "--meshes", "*.obj", "--out", "out", "--overwrite", *SMALL]
    assert main(arguments) == EXIT_BAD_INPUT
    error = capsys.readouterr().err
    assert "1 of 1 scene failed" in error and f"What was begun is in 'out/{UNFINISHED}'" in error
    assert before.items() <= state(tmp_path / "out").items()


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


def test_a_result_that_replaced_another_nowhere_names_the_hidden_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", "--out", str(tmp_path / "out"), *SMALL, *SHORT]
    small = ["--frames", "3", "--width", "48", "--height", "32"]
    assert main([*arguments, *small]) == EXIT_OK
    first = names(tmp_path / "out")
    capsys.readouterr()
    assert main([*arguments, *small, "--overwrite", "--seed", "1"]) == EXIT_OK
    assert names(tmp_path / "out") == first
    assert UNFINISHED not in "".join(capsys.readouterr())
    files = [path for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert [path for path in files if UNFINISHED.encode() in path.read_bytes()] == []
    assert main(["info", str(tmp_path / "out")]) == EXIT_OK


def test_the_functions_of_the_package_replace_no_file_of_others(
    capture: Path, tmp_path: Path
) -> None:
    for name in ("masks/0001.png", "images/0000.png"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text("precious")
    before = state(tmp_path)
    with pytest.raises(DigsError, match="move them away"):
        digs_warp.reconstruct(capture, out=tmp_path, iterations=2, masks="depth")
    with pytest.raises(DigsError, match="move them away"):
        digs_warp.simulate(out=tmp_path, frames=2, width=32, height=18)
    assert state(tmp_path) == before


def test_a_study_replaces_no_page_of_others(tmp_path: Path) -> None:
    (tmp_path / "report.md").write_text("precious")
    arguments = ["study", "run", "segmentation", "--time-budget", "0.001s"]
    assert main([*arguments, "--out", str(tmp_path)]) == EXIT_BAD_INPUT
    assert names(tmp_path) == ["report.md"]


@pytest.mark.parametrize("name", ["dangling", "loop", "to-file", "dangling/below"])
def test_a_link_that_leads_to_no_folder_is_named(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("precious")
    for link, target in (("dangling", "gone"), ("loop", "loop"), ("to-file", "file")):
        (tmp_path / link).symlink_to(tmp_path / target)
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


# Files


def test_a_file_is_not_replaced_by_what_is_made_from_it(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("v 0 0 0")
    arguments = ["plan", "--mesh", str(mesh), "--json", str(mesh), "--overwrite"]
    assert main(arguments) == EXIT_BAD_INPUT
    assert mesh.read_text() == "v 0 0 0"


def test_a_benchmark_replaces_a_file_only_when_told(tmp_path: Path) -> None:
    precious = tmp_path / "precious.json"
    precious.write_text("precious")
    assert main(["bench", "sfm", "--json", str(precious)]) == EXIT_BAD_INPUT
    assert precious.read_text() == "precious"
