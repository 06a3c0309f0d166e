"""The layers of a frame: which images a capture may hold for each moment, and the values of one."""

from enum import Enum, IntEnum


class Layer(Enum):
    """A kind of image that belongs to a frame. The value is its key in transforms.json.

    Attributes:
        label: its name in messages.
        pattern: its path in a capture folder, formatted with the frame's number.
    """

    label: str
    pattern: str

    IMAGE = "file_path", "left image", "images/{:04d}.png"
    RIGHT = "right_file_path", "right image", "right/{:04d}.png"
    DEPTH = "depth_file_path", "depth", "depth/{:04d}.exr"
    DEPTH_TRUE = "depth_true_file_path", "true depth", "depth_true/{:04d}.exr"
    MASK = "mask_path", "mask", "masks/{:04d}.png"
    UNKNOWN = "unknown_path", "what is no scene", "unknown/{:04d}.png"
    CAUSE = "cause_file_path", "cause", "cause/{:04d}.png"
    CONFIDENCE = "confidence_file_path", "confidence", "confidence/{:04d}.png"
    INFRARED_LEFT = "infrared_left_file_path", "left infrared image", "infrared_left/{:04d}.png"
    INFRARED_RIGHT = "infrared_right_file_path", "right infrared image", "infrared_right/{:04d}.png"
    NORMALS = "normals_file_path", "normals", "normals/{:04d}.exr"
    INSTANCES = "instances_file_path", "object numbers", "instances/{:04d}.png"
    DEPTH_RIGHT = "depth_right_file_path", "right eye's depth", "depth_right/{:04d}.exr"
    MASK_RIGHT = "mask_right_path", "right eye's mask", "masks_right/{:04d}.png"
    DISPARITY = "disparity_file_path", "disparity", "disparity/{:04d}.exr"
    DISPARITY_RIGHT = (
        "disparity_right_file_path",
        "right eye's disparity",
        "disparity_right/{:04d}.exr",
    )
    OCCLUSION = "occlusion_file_path", "occlusion", "occlusion/{:04d}.png"
    OCCLUSION_RIGHT = (
        "occlusion_right_file_path",
        "right eye's occlusion",
        "occlusion_right/{:04d}.png",
    )
    FLOW = "flow_file_path", "optical flow", "flow/{:04d}.exr"
    FLOW_OCCLUSION = "flow_occlusion_file_path", "flow occlusion", "flow_occlusion/{:04d}.png"

    def __new__(cls, key: str, label: str, pattern: str) -> "Layer":
        """Make a member whose value is the key alone."""
        layer = object.__new__(cls)
        layer._value_ = key
        layer.label, layer.pattern = label, pattern
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
