"""One object in one frame of a simulated recording: its pose, its boxes, and how much of it shows."""

from dataclasses import dataclass
from typing import Any

from digs_warp.data.placed_object import Matrix, is_placement, matrix_rows
from digs_warp.record.fields import Fields

# (x, y, width, height) [px]: the pixels from x to x + width - 1 and from y to y + height - 1.
Box = tuple[int, int, int, int]


@dataclass(frozen=True)
class ObjectView:
    """An object as a camera sees it; pixels count where their centers show it.

    Attributes:
        number: of the object, 1 or more.
        cam_from_object: rotation and translation [m] from the object to the camera, OpenCV axes, rows of a
            (4, 4) matrix. The object's frame is that of its mesh file, scaled to metres.
        pixels: that it would have if nothing hid it, also beyond the image's border, up to an image's width
            and height away.
        pixels_visible: that show it.
        box: around all of ``pixels``; may reach beyond the image. None: it has none.
        box_visible: around those that show it; None: there are none.
        silhouette: the pixels of the image that it would have if nothing hid it, as
            `digs_warp.data.run_lengths` writes them; None: they are those that show it.
    """

    number: int
    cam_from_object: Matrix
    pixels: int
    pixels_visible: int
    box: Box | None
    box_visible: Box | None
    silhouette: str | None = None

    @property
    def visible_share(self) -> float:
        """Share of its pixels that show, 0 to 1; 0 where it has none."""
        return self.pixels_visible / self.pixels if self.pixels else 0.0

    def as_json(self) -> dict[str, Any]:
        """Return the view in the form of transforms.json."""
        boxes = {"box": self.box, "box_visible": self.box_visible}
        return {
            "number": self.number,
            "cam_from_object": [list(row) for row in self.cam_from_object],
            "pixels": self.pixels,
            "pixels_visible": self.pixels_visible,
            "visible_share": self.visible_share,
            **{name: list(box) for name, box in boxes.items() if box is not None},
            **({} if self.silhouette is None else {"silhouette": self.silhouette}),
        }


def read_object_view(own: Fields) -> ObjectView:
    """Return what `ObjectView.as_json` wrote.

    Args:
        own: the entry of the object in a frame; its errors name the file.
    """
    matrix = own.array("cam_from_object", (4, 4))
    if not is_placement(matrix.tolist()):
        raise own.error(f"{own.where}: cam_from_object is no rotation with a translation")
    return ObjectView(
        number=own.whole("number", 1),
        cam_from_object=matrix_rows(matrix),
        pixels=own.whole("pixels", 0),
        pixels_visible=own.whole("pixels_visible", 0),
        box=_read_box(own, "box"),
        box_visible=_read_box(own, "box_visible"),
        silhouette=own.text("silhouette", None),
    )


def _read_box(own: Fields, name: str) -> Box | None:
    if name not in own:
        return None
    x, y, width, height = (int(value) for value in own.array(name, (4,)))
    return x, y, width, height
