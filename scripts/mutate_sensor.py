"""Put faults into the depth camera, one after the other, and see whether the test that is there notices.

    python scripts/mutate_sensor.py                          # all faults, some minutes
    python scripts/mutate_sensor.py --only holes-as-salt
    python scripts/mutate_sensor.py --page  # all, and the sum in docs/research/sensor-cost.md

A fault replaces a function or a constant in the process of the tests; no file changes. The exit code is 1 if
the test that is there for a fault does not notice it.
"""

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from mutations.catalogue import MUTATIONS, VARIABLE, find_mutation
from page_marks import fill

from digs_warp.record.progress import progress, show_progress

REPOSITORY = Path(__file__).resolve().parent.parent
PAGE = "research/sensor-cost.md"

# Tests of the default sensor and of the images that it reads.
TESTS = (
    "tests/sim/sensor/test_sensor_realism.py",
    "tests/sim/sensor/guided",
    "tests/sim/sensor/test_color_path.py",
    "tests/sim/sensor/test_depth_law.py",
    "tests/sim/sensor/effects/test_disparity_errors.py",
    "tests/sim/sensor/test_calibration_drift.py",
    "tests/sim/sensor/test_infrared_pair.py",
)


def failing(mutation: str, tests: Sequence[str] = TESTS, only: str = "") -> list[str]:
    """Return the tests that fail under a mutation ("": none), by file and function, sorted.

    Args:
        mutation: its name.
        tests: files to run.
        only: name of the function to run in them; "": all.

    Raises:
        RuntimeError: pytest did not run the tests.
    """
    # fmt: off
    command = [sys.executable, "-m", "pytest", "-q", "--tb=no", "-rfE", "-p", "mutations.catalogue",
               "-p", "no:cacheprovider", "-k", only, *tests]
    # fmt: on
    paths = (str(REPOSITORY), str(REPOSITORY / "scripts"), os.environ.get("PYTHONPATH", ""))
    environment = os.environ | {VARIABLE: mutation, "PYTHONPATH": os.pathsep.join(paths)}
    ran = subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=False
    )
    if ran.returncode not in (0, 1):  # 1: tests failed
        raise RuntimeError(f"{' '.join(command)}:\n{ran.stdout}{ran.stderr}")
    lines = re.findall(r"^(?:FAILED|ERROR) (\S+?)(?:\[.*)?(?: - .*)?$", ran.stdout, re.MULTILINE)
    return sorted(set(lines))


def unnoticed(found: dict[str, list[str]]) -> list[str]:
    """Return the faults that the test does not notice that is there for it."""
    return [
        name
        for name, tests in found.items()
        if find_mutation(name).meant not in {test.rpartition("::")[2] for test in tests}
    ]


def summary(found: dict[str, list[str]]) -> str:
    """Return the sentences of the page: how many faults are noticed, and which are not."""
    missed = unnoticed(found)
    noticed = len(found) - len(missed)
    lines = [f"{noticed} of {len(found)} faults are noticed by the test that is there for them."]
    lines += [f"- not noticed: {find_mutation(name).what}" for name in missed]
    return "\n".join(lines)


def main() -> int:
    """Try the mutations; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    names = [mutation.name for mutation in MUTATIONS]
    parser.add_argument("--only", action="append", choices=names, help="a fault; several")
    parser.add_argument(
        "--page", action="store_true", help=f"write how many are noticed into docs/{PAGE}"
    )
    options = parser.parse_args()
    show_progress()
    chosen = options.only or names
    found: dict[str, list[str]] = {}
    with progress(len(chosen), "Trying", "fault") as bar:
        for name in chosen:
            found[name] = failing(name, only=find_mutation(name).meant)
            bar.update()
            _say(f"{name}: {len(found[name])}\n" + "".join(f"    {t}\n" for t in found[name]))
    _say(summary(found))
    if options.page:
        _say(str(fill(PAGE, "mutations", summary(found))))
    return int(bool(unnoticed(found)))


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
