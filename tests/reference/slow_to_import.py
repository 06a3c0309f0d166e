"""A command whose import takes a second of the processor, for the test of the fuzzing command."""

import sys
import time
from collections.abc import Sequence


def slow_to_import(_words: Sequence[str]) -> int:
    """Do nothing."""
    return 0


# In worker processes only: the tests themselves need not wait.
while "pytest" not in sys.modules and time.process_time() < 1.0:
    pass
