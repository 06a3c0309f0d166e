"""Reads a capture folder: images, depths, masks and poses of one recording, on disk.

The index is nerfstudio's ``transforms.json``, so other tools can read the folder, too; it also has our
keys. Pixels are loaded on demand. The layout is described in docs/capture-format.md;
`digs_warp.data.capture_writer` writes it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.bounds import check_flag
from digs_warp.camera import Camera, Intrinsics
from digs_warp.checks import CaptureError, DigsError, require_folder
from digs_warp.data.about import About, read_about
from digs_warp.data.images import read_image
from digs_warp.data.index_rules import (
    check_section,
    require_metres,
    require_pinhole,
)
from digs_warp.data.label_loaders import LabelLoaders
from digs_warp.data.layers import Layer
from digs_warp.data.object_view import ObjectView, read_object_view
from digs_warp.data.other_folders import OF_A_CAMERA, what_it_is
from digs_warp.geometry import OPENCV_FROM_OPENGL
from digs_warp.record.fields import ABOVE_ZERO, Fields, shown
from digs_warp.record.files import read_json

INDEX_NAME = "transforms.json"

# Where a layer's pixels are: in a file, or in an array with the values that the file would have.
PixelSource = Path | np.ndarray


@dataclass(frozen=True)
class Rig:
    """The two eyes from which depth is measured, side by side along the x axis of the frame's camera.

    Attributes:
        baseline: distance of the eyes [m].
        infrared: the eyes are an infrared pair beside the frame's camera; None: the left eye is that camera.
    """

    baseline: float
    infrared: "InfraredPair | None" = None

    def as_json(self) -> dict[str, Any]:
        """Return the rig in the form of transforms.json."""
        pair = {} if self.infrared is None else {"infrared": asdict(self.infrared)}
        return {"baseline": self.baseline, **pair}


@dataclass(frozen=True)
class InfraredPair:
    """Two equal infrared cameras that look the same way as the frame's camera, at its image size.

    Attributes:
        offset: place of the left one along the x axis of the frame's camera [m].
        fl_x, fl_y, cx, cy: focal lengths and principal point of either [px].
    """

    offset: float
    fl_x: float
    fl_y: float
    cx: float
    cy: float


@dataclass(frozen=True, eq=False)
class Frame(LabelLoaders):
    """One moment of a recording: the left camera, the time [s], and where its pixels are.

    ``layers`` has a file or an array for each layer of the frame; only `Layer.IMAGE` is always there. An
    array holds what the file would hold (8 bits of sRGB, 8 bits of mask, float32 metres of depth, ...), so
    both are decoded by the same code. ``color_gain``: factors of automatic exposure and white balance on red,
    green and blue in linear light, against the common exposure of the recording; None: unknown. ``objects``:
    how each object of `About.objects` appears; empty if the recorder does not tell.
    """

    name: str
    camera: Camera
    time: float
    layers: Mapping[Layer, PixelSource]
    color_gain: tuple[float, float, float] | None = None
    objects: tuple[ObjectView, ...] = ()

    def load_image(self) -> np.ndarray:
        """Return the left image, sRGB, shape (height, width, 3), uint8."""
        return self._load_rgb(Layer.IMAGE)

    def load_right_image(self) -> np.ndarray:
        """Return the right image, sRGB, shape (height, width, 3), uint8.

        Its camera sits `Capture.right_offset` metres along the x axis of the left one.
        """
        return self._load_rgb(Layer.RIGHT)

    def load_infrared(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the left and the right infrared image, each (height, width), uint8."""
        return self._load_grey(Layer.INFRARED_LEFT), self._load_grey(Layer.INFRARED_RIGHT)

    def load_depth(self) -> np.ndarray:
        """Return the sensed planar depth [m], shape (height, width), float32, NaN where unknown."""
        return self._load_depth(Layer.DEPTH)

    def load_depth_true(self) -> np.ndarray:
        """Return the true planar depth [m], shape (height, width), float32, NaN where unknown."""
        return self._load_depth(Layer.DEPTH_TRUE)

    def load_mask(self) -> np.ndarray:
        """Return the object mask, 0..255, shape (height, width), uint8."""
        return self._load_grey(Layer.MASK)

    def load_cause(self) -> np.ndarray:
        """Return why each depth pixel is missing or wrong, shape (height, width), uint8; 0 if it is fine.

        `About.cause_labels` of the capture names the values.
        """
        return self._load_grey(Layer.CAUSE)

    def load_confidence(self) -> np.ndarray:
        """Return the sensor's confidence in its depth, 0 to 1, shape (height, width), float32."""
        return self._load_grey(Layer.CONFIDENCE).astype(np.float32) / np.float32(255)

    def load_instances(self) -> np.ndarray:
        """Return the number of the object at each pixel center, (height, width), uint8; 0: no object.

        `About.objects` of the capture names them, starting with number 1.
        """
        return self._load_grey(Layer.INSTANCES)

    def has(self, layer: Layer) -> bool:
        """Whether the frame has this layer."""
        return layer in self.layers

    def path(self, layer: Layer) -> Path:
        """Return the file of a layer.

        Raises:
            CaptureError: the frame lacks the layer, or holds it in memory.
        """
        source = self._source(layer)
        if isinstance(source, Path):
            return source
        raise CaptureError(
            f"{self._where(layer)}: in memory, expected a file; simulate with out=FOLDER"
        )

    def with_layer(self, layer: Layer, source: PixelSource) -> "Frame":
        """Return the frame with another source of a layer."""
        return replace(self, layers={**self.layers, layer: source})

    def _load_rgb(self, layer: Layer) -> np.ndarray:
        pixels = self._load(layer)
        if pixels.dtype != np.uint8 or pixels.shape[2] < 3:
            raise CaptureError(
                f"{self._where(layer)}: {pixels.shape[2]} channels of {pixels.dtype}, expected 3 of "
                "uint8; convert it to an 8-bit RGB PNG"
            )
        return np.ascontiguousarray(pixels[..., :3])

    def _load_grey(self, layer: Layer) -> np.ndarray:
        pixels = self._load(layer)
        if pixels.dtype != np.uint8:
            raise CaptureError(f"{self._where(layer)}: expected 8 bits per pixel")
        return pixels[..., 0]

    def _load_depth(self, layer: Layer) -> np.ndarray:
        pixels = self._load(layer)
        if pixels.dtype == np.uint16:  # 16-bit PNG: millimetres, 0 where unknown
            depth = pixels[..., 0].astype(np.float32) / np.float32(1000)
        elif pixels.dtype == np.float32:
            depth = pixels[..., 0].copy()
        else:
            raise CaptureError(
                f"{self._where(layer)}: {pixels.dtype}, expected a float EXR in metres or a 16-bit PNG "
                "in millimetres"
            )
        # Sensors mark missing depth as 0, negative, NaN or infinity; in memory it is NaN.
        depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
        return depth

    def _load(self, layer: Layer) -> np.ndarray:
        """Return the pixels as stored, shape (height, width, channels); the caller may change them."""
        source = self._source(layer)
        if isinstance(source, Path):
            pixels = read_image(source, what=layer.label)
        else:
            pixels = source.reshape(*source.shape[:2], -1).copy()
        k = self.camera.intrinsics
        if pixels.shape[:2] != (k.height, k.width):
            raise CaptureError(
                f"{self._where(layer)}: {pixels.shape[1]}x{pixels.shape[0]} pixels, expected "
                f"{k.width}x{k.height} as {INDEX_NAME} says; export the file again or correct w and h"
            )
        return pixels

    def _source(self, layer: Layer) -> PixelSource:
        if layer not in self.layers:
            raise CaptureError(f"frame '{self.name}': the capture has no '{layer.value}'")
        return self.layers[layer]

    def _where(self, layer: Layer) -> str:
        """Name a layer in a message."""
        source = self.layers[layer]
        of_file = f"{layer.label} '{source}'"
        return of_file if isinstance(source, Path) else f"frame '{self.name}', {layer.label}"


@dataclass(frozen=True, eq=False)
class Capture:
    """A recording: its frames in order of time, the rig (if stereo), and facts about the recording.

    ``stored_in`` is the folder it was read from; None if it was made in memory.
    """

    stored_in: Path | None
    frames: tuple[Frame, ...]
    rig: Rig | None
    about: About = field(default_factory=About)

    def __len__(self) -> int:
        return len(self.frames)

    def __str__(self) -> str:
        return "capture in memory" if self.stored_in is None else f"capture '{self.stored_in}'"

    @property
    def folder(self) -> Path:
        """The capture's folder.

        Raises:
            CaptureError: it has none because it was made in memory.
        """
        if self.stored_in is None:
            raise CaptureError(f"{self}: this needs a capture folder; simulate with out=FOLDER")
        return self.stored_in

    @property
    def right_offset(self) -> float | None:
        """Where right images are taken, along the x axis of the left camera [m]; None: there are none."""
        is_pair = self.rig is not None and self.rig.infrared is None
        return self.rig.baseline if self.rig and is_pair else None

    @property
    def knows_poses(self) -> bool:
        """Whether the poses are valid: a recording without poses has the identity in every frame."""
        return self.about.poses_known is not False

    @property
    def readout_time(self) -> float:
        """Time from the first row of an image to the last [s]; 0 if the recorder does not give it."""
        return self.about.readout_time or 0.0

    def split(self, test_every: int = 8) -> tuple[list[Frame], list[Frame]]:
        """Return (training, test) frames: every ``test_every``-th, starting at the first, is held out.

        Raises:
            DigsError: ``test_every`` is below 2, which would leave nothing to train on.
        """
        check_flag("--test-every", test_every)
        test = [frame for i, frame in enumerate(self.frames) if i % test_every == 0]
        train = [frame for i, frame in enumerate(self.frames) if i % test_every != 0]
        return train, test


def read_capture(folder: Path) -> Capture:
    """Open a capture folder; pixels stay on disk until a frame loads them.

    Raises:
        CaptureError: no or broken index, no frames, missing files, unusable poses or intrinsics, or a
            path that leaves the folder. The message names the frame and the key.
    """
    folder = require_folder(folder, "capture", f"'digs-warp simulate' writes one. {OF_A_CAMERA}")
    if not (folder / INDEX_NAME).is_file():
        raise CaptureError(
            f"capture '{folder}': no {INDEX_NAME} in it. {what_it_is(folder, INDEX_NAME)}"
        )
    index = read_json(folder / INDEX_NAME, "capture index")
    entries = index.get("frames")
    if not isinstance(entries, list) or not entries:
        raise CaptureError(f"capture '{folder}': {INDEX_NAME} lists no frames")
    ours = index.get("digs_warp", {})
    where = f"capture '{folder}', digs_warp in {INDEX_NAME}"
    if not isinstance(ours, dict):
        raise CaptureError(f"{where}: expected a JSON object, found {type(ours).__name__}")
    check_section(ours, where)
    rig = _read_rig(ours, where)
    about = read_about(ours, where)
    frames = tuple(_read_frame(folder, index, entry, i) for i, entry in enumerate(entries))
    _check_names_differ(folder, frames)
    return Capture(folder, frames, rig, about)


def _check_names_differ(folder: Path, frames: Sequence[Frame]) -> None:
    """Masks, renders and cameras of a frame are found again by its name."""
    first: dict[str, int] = {}
    for number, frame in enumerate(frames):
        if first.setdefault(frame.name, number) != number:
            raise CaptureError(
                f"capture '{folder}': frames {first[frame.name]} and {number} are both named '{frame.name}' "
                "after their images; rename one of the files, or leave one of the frames out"
            )


def _read_rig(ours: dict[str, Any], where: str) -> Rig | None:
    if "rig" not in ours:
        return None
    rig = Fields.of(ours["rig"], f"{where}, rig", CaptureError)
    baseline = rig.number("baseline", ABOVE_ZERO, what="metres above 0")
    if "infrared" not in rig:
        return Rig(baseline)
    pair = rig.section("infrared")
    fl_x, fl_y = (pair.number(name, ABOVE_ZERO, what="pixels above 0") for name in ("fl_x", "fl_y"))
    return Rig(
        baseline,
        InfraredPair(pair.number("offset"), fl_x, fl_y, pair.number("cx"), pair.number("cy")),
    )


def _read_frame(folder: Path, index: dict[str, Any], entry: Any, number: int) -> Frame:
    where = f"capture '{folder}', frame {number}"
    own = Fields.of(entry, where, CaptureError)
    require_pinhole(index, entry, f"{where} in {INDEX_NAME}")
    require_metres(index, entry, f"{where} in {INDEX_NAME}")
    camera = _read_camera(own, index)
    files = {
        layer: _inside(folder, own.text(layer.value), f"{where}, {layer.value}")
        for layer in Layer
        if layer.value in own
    }
    if Layer.IMAGE not in files:
        raise CaptureError(f"{where}: {INDEX_NAME} has no '{Layer.IMAGE.value}'")
    time = own.number("time", default=float(number))
    objects = tuple(map(read_object_view, own.sections("objects", [])))
    return Frame(files[Layer.IMAGE].stem, camera, time, files, _read_color_gain(own), objects)


def _read_color_gain(own: Fields) -> tuple[float, float, float] | None:
    if "color_gain" not in own:
        return None
    red, green, blue = gain = own.array("color_gain", (3,)).tolist()
    if min(gain) <= 0:
        raise CaptureError(f"{own.where}: color_gain is {shown(gain)}, expected numbers above 0")
    return red, green, blue


def _read_camera(own: Fields, index: dict[str, Any]) -> Camera:
    """Return the camera of a frame; nerfstudio lets it override the shared intrinsics."""
    k = replace(own, shared=index)
    size = k.whole("w", 1), k.whole("h", 1)
    fx, fy = (k.number(name, ABOVE_ZERO, what="pixels above 0") for name in ("fl_x", "fl_y"))
    cx, cy = (
        k.number(
            name,
            -side,
            2 * side,
            what=f"pixels from {-side} to {2 * side}, for images of {side}",
        )
        for name, side in zip(("cx", "cy"), size, strict=True)
    )
    intrinsics = Intrinsics(*size, fx, fy, cx, cy)
    try:
        return Camera(intrinsics, own.array("transform_matrix", (4, 4)) @ OPENCV_FROM_OPENGL)
    except DigsError as error:
        raise CaptureError(f"{own.where}: {error}") from error


def _inside(folder: Path, relative: str, where: str) -> Path:
    """Return the path of a file of the capture; reject one outside the folder."""
    path = folder / relative
    try:
        is_inside, exists = path.resolve().is_relative_to(folder.resolve()), path.is_file()
    except (OSError, RuntimeError) as error:  # a name that is too long; links that form a loop
        raise CaptureError(f"{where}: '{shown(relative)}' cannot be read ({error})") from error
    if not is_inside:
        raise CaptureError(
            f"{where}: '{relative}' leaves the capture folder; paths must stay inside"
        )
    if not exists:
        raise CaptureError(f"{where}: '{relative}' does not exist")
    return path
