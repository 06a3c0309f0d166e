"""The labels by name, as --labels takes them. Imports nothing heavy."""

from collections.abc import Sequence

from digs_warp.checks import DigsError
from digs_warp.data.layers import Layer
from digs_warp.words import did_you_mean

# Name -> its layers.
LABELS = {
    "right": (Layer.DEPTH_RIGHT, Layer.MASK_RIGHT),
    "disparity": (
        Layer.DISPARITY,
        Layer.DISPARITY_RIGHT,
        Layer.OCCLUSION,
        Layer.OCCLUSION_RIGHT,
    ),
    "flow": (Layer.FLOW, Layer.FLOW_OCCLUSION),
    "normals": (Layer.NORMALS,),
    "instances": (Layer.INSTANCES,),
}

# They say where points are in the next frame; the last one has none.
OF_NEXT_FRAME = LABELS["flow"]


def labels_named(selection: str) -> tuple[str, ...]:
    """Return the labels that a selection names, in the order of `LABELS`.

    Args:
        selection: "none", "all", or names separated by commas.

    Raises:
        DigsError: an unknown name.
    """
    if selection == "none":
        return ()
    named = LABELS if selection == "all" else selection.split(",")
    names = {name.strip() for name in named if name.strip()}
    unknown = sorted(names - set(LABELS))
    if unknown or not names:
        name = unknown[0] if unknown else selection
        known = ["none", "all", *LABELS]
        raise DigsError(f"--labels: no label '{name}'{did_you_mean(name, known)}")
    return tuple(name for name in LABELS if name in names)


def label_layers(names: Sequence[str], is_last: bool) -> tuple[Layer, ...]:
    """Return the layers of labels by name; the last frame of a recording has no next one."""
    layers = [layer for name in names for layer in LABELS[name]]
    return tuple(layer for layer in layers if not (is_last and layer in OF_NEXT_FRAME))
