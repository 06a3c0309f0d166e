"""The rules for writing results: old results go when new ones are complete, files of others stay."""

import logging
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import tyro

from digs_warp.checks import DigsError, kind_of
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.record.files import read_json, write_atomically
from digs_warp.record.layout import LOCK, MANIFEST, RUN_RECORD, UNFINISHED
from digs_warp.record.lock import remove_leftovers_of, sole_writer
from digs_warp.record.manifest import recorded_files
from digs_warp.record.progress import announced
from digs_warp.record.replacement import replace_result
from digs_warp.record.run_log import RunRecord

_log = logging.getLogger(__name__)


OUTPUT_FLAGS = ("out", "resume", "overwrite")  # of `OutputFolder`

DEVICES = Path("/dev")


@dataclass(frozen=True, kw_only=True)
class OutputFolder:
    """Where the results go."""

    out: Path
    """Folder for the results. It must be new or empty, unless --resume or --overwrite is given."""

    resume: tyro.conf.FlagCreatePairsOff[bool] = False
    """Continue an interrupted run that had the same settings."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the results of an earlier run in this folder once the new ones are complete. Files that no run
    wrote stay."""

    def __post_init__(self) -> None:
        if self.resume and self.overwrite:
            raise DigsError("--resume and --overwrite contradict each other; give one of them")

    @contextmanager
    def opened(self, inputs: Sequence[Path | None] = (), can_resume: bool = True) -> Iterator[Path]:
        """Yield the folder to write into: ``out``, or a hidden one in it that becomes the result at the end.

        Args:
            inputs: what the command reads; it must be there, and not in the folder that is written.
            can_resume: whether an interrupted run can go on in the folder; else an error leaves nothing.

        Raises:
            DigsError: an input is missing, the folder is in use and no flag says what to do, or it cannot be
                overwritten.
        """
        needed = _check_inputs(self.out, inputs)
        with sole_writer(self.out):
            with announced("start"):
                work = self._workplace(needed, can_resume)
            try:
                with _written_for(self.out, work, can_resume), recorded_files(work, self.resume):
                    yield work
                if work != self.out:
                    replace_result(self.out)
            except BaseException as error:
                if not can_resume:
                    shutil.rmtree(work, ignore_errors=True)
                # Of an interrupted --overwrite the folder stays, also empty: --resume must not take the old
                # result for the new one.
                elif work == self.out or not isinstance(error, KeyboardInterrupt):
                    _remove_mere_records(work)
                raise

    def _workplace(self, needed: Sequence[Path], can_resume: bool) -> Path:
        unfinished = self.out / UNFINISHED
        if self.resume:
            if not unfinished.is_dir():
                return self.out
            _log.info("'%s': going on with the new result that --overwrite began", self.out)
            return unfinished
        _check_free(self.out, self.overwrite, needed)
        shutil.rmtree(unfinished, ignore_errors=True)
        if can_resume and not _is_used(self.out):
            return self.out
        unfinished.mkdir()
        return unfinished


# Stands for a folder that is still to be named.
ANY_FOLDER = OutputFolder(out=tyro.MISSING)


def check_output_file(
    path: Path, overwrite: bool, inputs: Sequence[Path | None] = (), flag: str = "--out"
) -> None:
    """Check that a file may be written, and delete what killed processes left of it.

    Args:
        path: the file.
        overwrite: whether it may exist.
        inputs: what the command reads, which cannot be the file.
        flag: that names the file.

    Raises:
        DigsError: it may not be written.
    """
    if path.exists() and not path.is_file():
        raise DigsError(f"{flag} '{path}': this is {_named(path)}; name a new file")
    if path.absolute().parent == DEVICES:  # /dev/stdout leads to a file that would replace the link
        raise DigsError(f"{flag} '{path}': this is in {DEVICES}; name a new file")
    if path.exists() and not overwrite:
        raise DigsError(f"{flag} '{path}': the file exists; add --overwrite or name another file")
    for source in inputs:
        if source is not None and source.exists() and path.exists() and path.samefile(source):
            raise DigsError(f"{flag} '{path}': is the source itself; name another file")
    _check_writable(path, flag)
    remove_leftovers_of(path)


@dataclass(frozen=True, kw_only=True)
class JsonFile:
    """Where the result goes, besides the terminal."""

    json: Path | None = None
    """Also write the result to this file, with all details."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace that file if it exists."""

    def check(self, *inputs: Path | None) -> None:
        """Raise a `DigsError` when the file exists and may not be replaced, or is one of the inputs."""
        if self.json is not None:
            check_output_file(self.json, self.overwrite, inputs, flag="--json")

    def write(self, text: str) -> None:
        """Write the file, if there is to be one."""
        if self.json is not None:
            write_atomically(self.json, text.encode())


def is_ours(folder: Path) -> bool:
    """Whether this program wrote ``folder``: it holds a run record or a capture index of ours."""
    try:
        if (folder / RUN_RECORD).is_file():
            return RunRecord.find(folder) is not None
        return "digs_warp" in read_json(folder / INDEX_NAME, "capture index")
    except DigsError:
        return False


def _check_inputs(out: Path, inputs: Sequence[Path | None]) -> list[Path]:
    """Return the inputs that there are, after all checks that change nothing."""
    needed = [path for path in inputs if path is not None]
    for path in needed:
        if not path.exists():
            raise DigsError(f"'{path}': no such file or folder. Check the path.")
    if out.exists() and not out.is_dir():
        raise DigsError(f"--out '{out}': this is {_named(out)}; name a folder")
    _check_writable(out)
    return needed


def _named(path: Path) -> str:
    """Return what an existing path is, and where it leads if it is a link."""
    kind = kind_of(path)
    return f"a link to {kind} ('{path.readlink()}')" if path.is_symlink() else kind


def _check_writable(path: Path, flag: str = "--out") -> None:
    """Check that a file or folder can be made, without making it."""
    path = path.absolute()
    place = next(each for each in (path, *path.parents) if each.exists())
    if place != path and not place.is_dir():
        raise DigsError(f"{flag} '{path}': '{place}' is {_named(place)}; name another place")
    folder = place if place.is_dir() else place.parent
    if not os.access(folder, os.W_OK | os.X_OK):
        raise DigsError(f"{flag} '{path}': '{folder}' is not writable; name another place")


def _check_free(out: Path, overwrite: bool, needed: Sequence[Path]) -> None:
    """Check that new results may be written into a folder."""
    is_used = _is_used(out)
    if not overwrite and (is_used or _is_used(out / UNFINISHED)):
        raise DigsError(
            f"--out '{out}': the folder is not empty. Add --resume to go on with an "
            "interrupted run, --overwrite to start again, or name another folder."
        )
    if not is_used:
        return
    if not is_ours(out):
        raise DigsError(
            f"--out '{out}': --overwrite replaces only results that digs-warp wrote, and this folder has no "
            f"{RUN_RECORD} of ours. Name another folder."
        )
    for path in [*needed, Path.cwd()]:
        if path.resolve().is_relative_to(out.resolve()):
            raise DigsError(
                f"--out '{out}': --overwrite would delete '{path}', which this run needs; "
                "name another folder"
            )


def _is_used(folder: Path) -> bool:
    """Whether there is more in it than the records of a run that failed before it made anything."""
    return any(
        path.name != LOCK
        and UNFINISHED not in path.relative_to(folder).parts
        and not (path.name in (RUN_RECORD, MANIFEST) and is_ours(path.parent))
        for path in folder.rglob("*")
        if not path.is_dir() or path.is_symlink()
    )


def _remove_mere_records(folder: Path) -> None:
    """Delete the records of a run that failed before it made anything."""
    if _is_used(folder):
        return
    if folder.name == UNFINISHED:
        shutil.rmtree(folder, ignore_errors=True)
    for place, _, _ in os.walk(folder, topdown=False):
        for name in (RUN_RECORD, MANIFEST):
            (Path(place) / name).unlink(missing_ok=True)
        with suppress(OSError):  # the folder of a run, with its lock
            Path(place).rmdir()


@contextmanager
def _written_for(out: Path, work: Path, is_kept: bool) -> Iterator[None]:
    """Name the folder that the user named in errors of the block, which writes into ``work``."""
    try:
        yield
    except (DigsError, OSError) as error:
        if work == out or str(work) not in str(error):
            raise
        text = str(error).replace(str(work), str(out))
        kept = f" What was begun is in '{work}'." if is_kept and _is_used(work) else ""
        raise DigsError(f"{text}{kept}") from error
