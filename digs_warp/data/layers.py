"""The layers of a frame: which images a capture may hold for each moment, and the values of one."""

from enum import Enum, IntEnum

# What the pixels of a layer are: sRGB or 8 bits, in PNG; depth, other numbers, or three of them, in EXR.
COLOR, GRAY, METRES, NUMBERS, VECTORS = "color", "gray", "metres", "numbers", "vectors"


class Layer(Enum):
    """A kind of image that belongs to a frame. The value is its key in transforms.json.

    Attributes:
        label: its name in messages.
        kind: what its pixels are.
        pattern: its path in a capture folder, formatted with the frame's number.
    """

    label: str
    kind: str
    pattern: str

    IMAGE = "file_path", "left image", "images", COLOR
    RIGHT = "right_file_path", "right image", "right", COLOR
    DEPTH = "depth_file_path", "depth", "depth", METRES
    DEPTH_TRUE = "depth_true_file_path", "true depth", "depth_true", METRES
    MASK = "mask_path", "mask", "masks", GRAY
    UNKNOWN = "unknown_path", "what is no scene", "unknown", GRAY
    CAUSE = "cause_file_path", "cause", "cause", GRAY
    CONFIDENCE = "confidence_file_path", "confidence", "confidence", GRAY
    INFRARED_LEFT = "infrared_left_file_path", "left infrared image", "infrared_left", GRAY
    INFRARED_RIGHT = "infrared_right_file_path", "right infrared image", "infrared_right", GRAY
    NORMALS = "normals_file_path", "normals", "normals", VECTORS
    INSTANCES = "instances_file_path", "object numbers", "instances", GRAY
    DEPTH_RIGHT = "depth_right_file_path", "right eye's depth", "depth_right", METRES
    MASK_RIGHT = "mask_right_path", "right eye's mask", "masks_right", GRAY
    DISPARITY = "disparity_file_path", "disparity", "disparity", NUMBERS
    DISPARITY_RIGHT = (
        "disparity_right_file_path",
        "right eye's disparity",
        "disparity_right",
        NUMBERS,
    )
    OCCLUSION = "occlusion_file_path", "occlusion", "occlusion", GRAY
    OCCLUSION_RIGHT = "occlusion_right_file_path", "right eye's occlusion", "occlusion_right", GRAY
    FLOW = "flow_file_path", "optical flow", "flow", VECTORS
    FLOW_OCCLUSION = "flow_occlusion_file_path", "flow occlusion", "flow_occlusion", GRAY

    def __new__(cls, key: str, label: str, folder: str, kind: str) -> "Layer":
        """Make a member whose value is the key alone."""
        layer = object.__new__(cls)
        layer._value_ = key
        layer.label, layer.kind = label, kind
        layer.pattern = f"{folder}/{{:04d}}.{'png' if kind in (COLOR, GRAY) else 'exr'}"
        return layer


# The layers of every frame of a color stereo camera; the others exist for some sensors, or on request.
BASIC_LAYERS = (Layer.IMAGE, Layer.RIGHT, Layer.DEPTH, Layer.DEPTH_TRUE, Layer.MASK)

# The same for a color camera beside an infrared pair.
INFRARED_LAYERS = (
    Layer.IMAGE,
    Layer.INFRARED_LEFT,
    Layer.INFRARED_RIGHT,
    Layer.DEPTH,
    Layer.DEPTH_TRUE,
    Layer.MASK,
)


class Occlusion(IntEnum):
    """Whether another image, the other eye's or the next frame's, shows the point at a pixel center."""

    SEEN = 0
    OUTSIDE = 128  # the point projects outside of that image; what hides it was not checked
    HIDDEN = 255  # something is in front of the point, or that camera sees the back of the same thin sheet
