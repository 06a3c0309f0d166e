"""The filters by name, as --filters takes them. Imports nothing heavy."""

from digs_warp.checks import DigsError
from digs_warp.words import did_you_mean

# Name -> what it does, in the order in which filters act, which is the one that librealsense recommends.
FILTERS = {
    "dense": "stands for the neural depth modes of the ZED family: smooth, hardly any holes, blurred steps",
    "spatial": "librealsense's spatial filter: less noise along rows and columns, steps stay",
    "temporal": "librealsense's temporal filter, over the three frames before, at 30 frames per second",
    "hole-filling": "librealsense's hole filling, from the farthest of the four neighbors",
    "hole-filling-left": "the same, from the left neighbor",
    "hole-filling-nearest": "the same, from the nearest of the four neighbors",
}


def filters_named(selection: str) -> tuple[str, ...]:
    """Return the filters that a selection names, in the order in which they act.

    Args:
        selection: "none", or names separated by commas.

    Raises:
        DigsError: an unknown name, or two ways to fill holes.
    """
    if selection == "none":
        return ()
    names = {name.strip() for name in selection.split(",") if name.strip()}
    unknown = sorted(names - set(FILTERS))
    if unknown or not names:
        name = unknown[0] if unknown else selection
        raise DigsError(f"--filters: no filter '{name}'{did_you_mean(name, ['none', *FILTERS])}")
    ways = sorted(name for name in names if name.startswith("hole-filling"))
    if len(ways) > 1:
        raise DigsError(
            f"--filters {', '.join(ways)}: the first one leaves the others no holes; name one of them"
        )
    return tuple(name for name in FILTERS if name in names)
