"""The light that a camera meters along its walk: tiny renders at many moments.

Exposure and white balance depend on what the camera saw before. Frames must not depend on each other, so the
light is metered before the first one, at the same moments whatever the frames are.
"""

import math

import numpy as np

from digs_warp.device.threads import over_rows
from digs_warp.geometry.camera import Camera
from digs_warp.sim.record.session import Session
from digs_warp.sim.sensor.color.adaptation import AdaptationTrack, targets
from digs_warp.sim.sensor.color.encoding import decode

# Metered moments of a whole walk, which takes a minute or two; and how far apart they are at most [s].
MOMENTS = 200
LONGEST_STEP = 1.0

# Width of the renders [px]; a mean needs no more.
WIDTH = 32

# Renders that a thread takes at a time.
TOGETHER = 10

# Identifies the pixel sampling in the seeds, beside the eyes of `digs_warp.sim.record.session`.
METER = 104


def meter_walk(session: Session) -> AdaptationTrack:
    """Return how exposure and white balance follow the light up to the last frame.

    A camera that has settled starts. The light is metered behind the lens without its vignetting.
    """
    step = min(session.walk.end / MOMENTS, LONGEST_STEP)
    count = math.ceil(session.moments[-1] / step) + 1
    times = step * np.arange(count)
    colors = np.empty((count, 3))

    def meter(numbers: range) -> None:
        for number in numbers:
            colors[number] = _mean_color(session, number, times[number])

    meter(range(1))  # alone: it prepares the scene for all of them
    others = range(1, count)
    over_rows(len(others), lambda rows: meter(others[rows]), TOGETHER)
    return AdaptationTrack.following(times, targets(colors, session.rig), session.rig)


def _mean_color(session: Session, number: int, moment: float) -> np.ndarray:
    """Return the mean of the recorded image in linear light, shape (3,)."""
    k, config = session.rig.image_intrinsics, session.config
    small = k.resized(WIDTH, max(1, round(WIDTH * k.height / k.width)))
    camera = Camera(small, session.walk.pose(moment))
    seed = np.random.SeedSequence([config.seed, number, METER]).generate_state(1)[0]
    image, _ = session.renderer.render_image(camera, config.samples_per_pixel, int(seed))
    return decode(image).mean(axis=(0, 1), dtype=np.float64)
