"""The command line: parses the flags, runs the command, turns what happens into an exit code.

Starting up must stay quick, so this module and the commands' modules import only what the help needs;
everything heavy is imported when a command runs. `tests/test_import.py` keeps it so.
"""

import logging
import os
import shlex
import sys
from collections.abc import Sequence
from io import TextIOWrapper

from tqdm import tqdm

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command
from digs_warp.commands.parse import (
    PROGRAM,
    CommonFlags,
    read_command,
    take_common_flags,
)
from digs_warp.device.libraries import missing_library
from digs_warp.record.interruption import Stopped, stopped_by_signals
from digs_warp.record.progress import show_progress
from digs_warp.record.run_log import source_commit, versions

EXIT_OK = 0
EXIT_BAD_INPUT = 1
EXIT_WRONG_USAGE = 2  # tyro's own code
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as shells report it; 143 for SIGTERM, 129 for SIGHUP
EXIT_NO_READER = 141  # 128 + SIGPIPE

# Loggers whose news are always worth a line: the first run compiles kernels for minutes, and a log file
# shows no progress bars.
TALKATIVE = ("digs_warp.kernels", "digs_warp.record.progress", "digs_warp.commands.output")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line (default: this process's) and return the exit code.

    0: done; 1: bad input, explained on stderr; 2: wrong usage; 130: interrupted with Ctrl-C; 143 and 129:
    with SIGTERM and SIGHUP; 141: nobody reads the output any more (``digs-warp run --help | head``).
    """
    _mend_streams()
    try:
        code = _run(argv)
        sys.stdout.flush()
    except ImportError as error:
        missing = missing_library(error)
        if missing is None:
            raise
        _complain(str(missing))
        return EXIT_BAD_INPUT
    except UnicodeEncodeError as error:
        near = error.object[max(0, error.start - 30) : error.end + 30]
        _complain(f"{near!r}: a name that is no UTF-8, which is not possible here; rename it")
        return EXIT_BAD_INPUT
    except BrokenPipeError:
        _drop_output()
        return EXIT_NO_READER
    except OSError as error:  # of the output alone: those of a command are told where it runs
        _drop_output()
        _complain(
            f"the output could not be written: {error.strerror}. Free some space, or send it elsewhere"
        )
        return EXIT_BAD_INPUT
    return code


def _mend_streams() -> None:
    """Let any text be printed: file names that are no text, all in a locale of ASCII, into closed streams."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # its number would be that of the next file
            stream = open(os.devnull, "w", encoding="utf-8")
            setattr(sys, name, stream)
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _drop_output() -> None:
    """Send what is left of the output nowhere: the interpreter flushes once more at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(argv: Sequence[str] | None) -> int:
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        common, command = _read(arguments)
    except SystemExit as stop:  # tyro has printed the help or what is wrong
        return stop.code if isinstance(stop.code, int) else EXIT_OK
    except DigsError as error:  # a value that its settings refuse
        _complain(str(error))
        return EXIT_WRONG_USAGE
    _log_to_stderr(common)
    show_progress(not common.quiet)
    try:
        with stopped_by_signals():
            result = command.execute()
    except (DigsError, OSError) as error:
        _complain(str(error))
        return EXIT_BAD_INPUT
    except KeyboardInterrupt as interrupt:
        by = f" by {interrupt}" if isinstance(interrupt, Stopped) else ""
        _complain(f"interrupted{by}. {_how_to_go_on(arguments, command)}")
        return 128 + interrupt.number if isinstance(interrupt, Stopped) else EXIT_INTERRUPTED
    print(result)
    return EXIT_OK


def parse(arguments: Sequence[str]) -> Command:
    """Return the command that ``arguments`` describe, without running it.

    Raises:
        SystemExit: with code 0 after printing help or the version, with 2 after explaining wrong usage.
        DigsError: an unknown command, or a value out of its range.
    """
    return _read(arguments)[1]


def _read(arguments: Sequence[str]) -> tuple[CommonFlags, Command]:
    common, words = take_common_flags(arguments)
    if common.version:
        commit = source_commit()  # None for an installed package
        print(f"{PROGRAM} {versions()['digs-warp']}{f', commit {commit[:10]}' if commit else ''}")
        raise SystemExit(EXIT_OK)
    return common, read_command(words, common)


def _complain(message: str) -> None:
    print(f"{PROGRAM}: {message}", file=sys.stderr)


def _how_to_go_on(arguments: Sequence[str], command: Command) -> str:
    if not command.can_resume:
        return "Nothing was written."
    again = [argument for argument in arguments if argument not in ("--overwrite", "--resume")]
    # A command with an output folder needs --resume; a study resumes by itself.
    resume = ["--resume"] if hasattr(command, "output") else []
    return f"To go on where it stopped: {shlex.join([PROGRAM, *again, *resume])}"


class _BesideTheBars(logging.Handler):
    """Writes log lines so that they do not tear a progress bar apart."""

    def emit(self, record: logging.LogRecord) -> None:
        tqdm.write(self.format(record), file=sys.stderr)


def _log_to_stderr(common: CommonFlags) -> None:
    handler = _BesideTheBars()
    handler.setFormatter(logging.Formatter("%(levelname)s: %(message)s"))
    usual = logging.ERROR if common.quiet else logging.WARNING
    logging.basicConfig(level=usual, handlers=[handler], force=True)
    logging.getLogger("digs_warp").setLevel(logging.DEBUG if common.verbose else logging.NOTSET)
    for name in TALKATIVE:
        talk = logging.NOTSET if common.quiet or common.verbose else logging.INFO
        logging.getLogger(name).setLevel(talk)
