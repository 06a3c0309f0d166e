"""The memory of a recording does not grow with the number of its frames."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.data.images import write_image

FRAMES = 4

# What a recording has in hand for a frame of this size is five megabytes: kept, it would be sixty.
LIMIT = 25e6

# In a new process: the peak of this one may come from another test.
SCRIPT = """
import resource, sys
from dataclasses import replace
from pathlib import Path
from digs_warp.sim.record.record import SimulateConfig, simulate
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.session import prepare_session

folder, frames = Path(sys.argv[1]), int(sys.argv[2])
config = SimulateConfig(
    mesh=folder / "box.glb", environment=folder / "sky.png", frames=4 * frames,
    width=320, height=180, samples_per_pixel=1, effects="none", ground="none",
)
session = prepare_session(config, load_inputs(config))
for count in (frames, 4 * frames):
    fewer = replace(config, frames=count)
    simulate(fewer, folder / str(count), session=replace(session, config=fewer))
    print(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.long
def test_frames_are_not_kept(tmp_path: Path) -> None:
    trimesh.creation.box((0.3, 0.2, 0.2)).export(tmp_path / "box.glb")
    sky = np.random.default_rng(0).integers(0, 256, (16, 32, 3), dtype=np.uint8)
    write_image(tmp_path / "sky.png", sky)
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path), str(FRAMES)],
        capture_output=True,
        text=True,
        check=True,
    )
    few, many = (int(line) for line in run.stdout.split())
    assert many - few < LIMIT
