"""A training that a signal reaches in its middle, on however busy a machine."""

import signal
import subprocess
import sys
from collections.abc import Sequence

STEP = 40

SCRIPT = """
import os, sys
from digs_warp.cli import main
from digs_warp.train.trainer import Trainer

step, number, usual = int(sys.argv[1]), int(sys.argv[2]), Trainer.step

def step_and_signal(trainer):
    usual(trainer)
    if trainer.optimizer.step == step:
        os.kill(os.getpid(), number)

Trainer.step = step_and_signal
sys.exit(main(sys.argv[3:]))
"""


def train_until(
    number: signal.Signals, arguments: Sequence[str]
) -> subprocess.CompletedProcess[str]:
    """Run a command line in another process, which gets the signal after `STEP` steps."""
    command = [sys.executable, "-c", SCRIPT, str(STEP), str(int(number)), *arguments]
    return subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
