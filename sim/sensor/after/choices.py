"""What the user asks of the device after matching, as the plan of a recording lists it."""

from digs_warp.sim.sensor.after.chain import AfterMatching
from digs_warp.sim.sensor.after.names import FILTERS
from digs_warp.sim.sensor.effects.protocol import Choice

# Time of each on one core [ms per megapixel], rounded up from the table in docs/sensor.md.
COSTS = {
    "dense": 25,
    "spatial": 7,
    "temporal": 20,
    "hole-filling": 11,
    "hole-filling-left": 11,
    "hole-filling-nearest": 11,
}


def choices_of(device: AfterMatching) -> tuple[Choice, ...]:
    """Return a choice for the threshold and for each filter, in the order in which they act.

    All are on: nothing but the user decides about them.
    """
    choices = []
    if device.threshold > 0:
        reason = "asked for: doubtful matches are dropped"
        measured = f"confidence_threshold = {device.threshold:g}"
        choices.append(Choice("confidence-threshold", True, measured, "> 0", reason))
    for name in device.filters:
        reason = f"asked for: {FILTERS[name]}"
        if name == "temporal":
            reason += f", and {device.earlier_frames} more frames to render and match for each"
        choices.append(Choice(name, True, "", "", reason, 1.0, COSTS[name]))
    return tuple(choices)
