"""The switches beside the scene: what they are called, and what they say now."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

from digs_warp.show.view import nodes
from digs_warp.show.view.contents import RESULT, Contents
from digs_warp.show.view.nodes import Picture, pictures_of
from digs_warp.show.view.placement import RADIUS, Box
from digs_warp.show.view.streamer import Shown

if TYPE_CHECKING:
    import viser

# How several contents stand: all in a row, or one of them alone.
SIDE_BY_SIDE = "side by side"

# The browser draws the Gaussians itself.
BY_BROWSER = "in the browser"

Action = Callable[[], None]


class Controls:
    """The switches of a page.

    Args:
        gui: of the server.
        contents: what the page shows.

    Attributes:
        standing: of several contents, all side by side or one alone.
        layers: what is shown and hidden, by name.
        stage: the place in the training, from 0 to 1.
        label: says in words which Gaussians are shown.
        drawn: by whom, and what.
        cuts: whether Gaussians outside of the box are left out.
        box_center: of the box [page units].
        box_size: of the box [page units].
    """

    def __init__(self, gui: "viser.GuiApi", contents: Sequence[Contents]) -> None:
        self._gui = gui
        # Numbered: two folders may have the same name.
        self._names = [f"{n}: {each.name}" for n, each in enumerate(contents, start=1)]
        for name, each in zip(self._names, contents, strict=True):
            title = name if len(contents) > 1 else each.name
            gui.add_markdown(f"**{title}**  \n" + "  \n".join(each.facts))
        self.standing = gui.add_dropdown(
            "Compare",
            [SIDE_BY_SIDE, *self._names],
            hint="All in a row, or one after the other in the same place.",
            visible=len(contents) > 1,
        )
        has_gaussians = any(each.stages for each in contents)
        self.layers = self._add_layers(contents, has_gaussians)
        frames = tuple(frame for each in contents for frame in each.frames)
        self._pictures = gui.add_dropdown(
            "Cameras show",
            pictures_of(frames),
            hint="A click on a camera goes there.",
            visible=bool(frames),
        )
        most = max(len(each.stages) for each in contents)
        self.stage = gui.add_slider(
            *("Training", 0.0, 1.0, 1.0 / max(1, most - 1), 1.0),
            hint="From the start of the training (left) to the result (right).",
            visible=most > 1,
        )
        label = _label_of(contents, 1.0)
        told = most > 1 or label not in ("", RESULT)
        self.label = gui.add_text("Shown", label, disabled=True, visible=told)
        self._labels = contents
        self.drawn = gui.add_dropdown(
            "Drawn",
            [BY_BROWSER, "color", "depth", "normals"],
            hint="Color, depth and normals are drawn by the rasterizer that trained the Gaussians. Depth: "
            "yellow is the nearest in view, violet the farthest.",
            visible=has_gaussians,
        )
        self._add_crop(has_gaussians)

    @property
    def true_render(self) -> Shown | None:
        """What our rasterizer draws; None: nothing."""
        value = self.drawn.value
        return None if value == BY_BROWSER else cast(Shown, value)

    @property
    def pictures(self) -> Picture:
        """What the cameras show."""
        return cast(Picture, self._pictures.value)

    @property
    def box(self) -> Box | None:
        """What the Gaussians are cut to; None: nothing is cut."""
        if not self.cuts.value:
            return None
        return Box(self.box_center.value, self.box_size.value)

    @property
    def numbers(self) -> list[int]:
        """The contents that are shown, in their order."""
        if self.standing.value == SIDE_BY_SIDE:
            return list(range(len(self._names)))
        return [self._names.index(self.standing.value)]

    def stage_of(self, count: int) -> int:
        """Return which of ``count`` stages is shown."""
        return round(self.stage.value * (count - 1))

    def shows(self, number: int, layer: str) -> bool:
        """Return whether a layer of the contents with this number is to be seen."""
        return number in self.numbers and self.layers[layer].value

    def on_stage(self, action: Action) -> None:
        """Call ``action`` when another stage is chosen."""

        @self.stage.on_update
        def _(_: object) -> None:
            self.label.value = _label_of(self._labels, self.stage.value)
            action()

    def on_choice(self, action: Action) -> None:
        """Call ``action`` when something is shown, hidden or drawn in another way."""
        for switch in (*self.layers.values(), self.drawn):
            switch.on_update(lambda _: action())

    def on_standing(self, action: Action) -> None:
        """Call ``action`` when other contents are to be shown."""
        self.standing.on_update(lambda _: action())

    def on_pictures(self, action: Action) -> None:
        """Call ``action`` when the cameras are to show something else."""
        self._pictures.on_update(lambda _: action())

    def on_crop(self, action: Action) -> None:
        """Call ``action`` when something else is cut."""
        self.cuts.on_update(lambda _: action())
        for side in (self.box_center, self.box_size):
            side.on_update(lambda _: action() if self.cuts.value else None)

    def on_save(self, save: Callable[[Path], str]) -> None:
        """Call ``save`` with the file's name when the button is pressed, and show what it returns."""

        @self._save.on_click
        def _(_: object) -> None:
            self._saved.content = save(Path(self._target.value).expanduser())

    def _add_layers(
        self, contents: Sequence[Contents], has_gaussians: bool
    ) -> "dict[str, viser.GuiCheckboxHandle]":
        names = [nodes.GAUSSIANS] if has_gaussians else []
        names += [nodes.CAMERAS] if any(each.frames for each in contents) else []
        names += [name for each in contents for name in (*each.points, *each.meshes)]
        layers = {}
        for name in dict.fromkeys(names):
            # Points and meshes would cover the Gaussians.
            first = name in (nodes.GAUSSIANS, nodes.CAMERAS) or not has_gaussians
            layers[name] = self._gui.add_checkbox(name.capitalize(), first)
        return layers

    def _add_crop(self, visible: bool) -> None:
        gui = self._gui
        with gui.add_folder("Crop and save", expand_by_default=False, visible=visible):
            self.cuts = gui.add_checkbox("Crop to the box", False)
            step = RADIUS / 100
            self.box_center = gui.add_vector3("Center", (0.0, 0.0, 0.0), step=step)
            self.box_size = gui.add_vector3("Size", (2 * RADIUS, 2 * RADIUS, 2 * RADIUS), step=step)
            self._target = gui.add_text(
                "File", "cropped.usdz", hint="Its suffix decides the format."
            )
            self._save = gui.add_button("Save what is shown")
            self._saved = gui.add_markdown("")


def _label_of(contents: Sequence[Contents], place: float) -> str:
    """Return what is shown at a place in 0..1 of the slider."""
    labels = [
        each.stages[round(place * (len(each.stages) - 1))].label for each in contents if each.stages
    ]
    return ", ".join(dict.fromkeys(labels))
