"""A command whose import takes a second of the processor, for the test of the fuzzing command."""

import time
from collections.abc import Sequence
from multiprocessing import current_process


def slow_to_import(_words: Sequence[str]) -> int:
    """Do nothing."""
    return 0


# In worker processes only: the tests themselves need not wait.
while current_process().name != "MainProcess" and time.process_time() < 1.0:
    pass
