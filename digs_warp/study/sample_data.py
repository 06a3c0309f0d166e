"""Where the sample data lies that benchmarks and studies take when it is there."""

import os
from pathlib import Path


def sample_data() -> Path:
    """The folder of the sample data: DIGS_WARP_SAMPLE_DATA, or ../shared/data."""
    return Path(os.environ.get("DIGS_WARP_SAMPLE_DATA", "../shared/data"))
