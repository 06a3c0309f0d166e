"""The page: what its switches do to the scene in the browser."""

import logging
import threading
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import NO_FILTER, Gaussians, joined
from digs_warp.geometry.rigid import quat_xyzw_from_matrix
from digs_warp.show.view import nodes
from digs_warp.show.view.contents import Contents, Stage
from digs_warp.show.view.controls import Controls
from digs_warp.show.view.placement import RADIUS, Placement, save_cropped, side_by_side
from digs_warp.show.view.streamer import Shown, Streamer, TrueRenderer

if TYPE_CHECKING:
    import viser


logger = logging.getLogger(__name__)

ORIGIN = (0.0, 0.0, 0.0)

# Where a browser's camera starts [page units].
FIRST_EYE = (0.0, -2.2 * RADIUS, 0.8 * RADIUS)


class Page:
    """Shows contents in every browser that opens the server's address.

    Args:
        server: of viser, just started.
        contents: what to show; several stand side by side.
    """

    def __init__(self, server: "viser.ViserServer", contents: Sequence[Contents]) -> None:
        self._server = server
        self._contents = list(contents)
        self._placements = _placed(contents)
        # What a content's nodes hang on: it moves all of them, and nothing is sent again.
        self._stands = [
            server.scene.add_frame(f"/{number}", show_axes=False) for number in range(len(contents))
        ]
        self._nodes: dict[tuple[int, str], list[viser.SceneNodeHandle]] = {}
        self._streamers: dict[int, Streamer] = {}
        self._changing = threading.RLock()
        self._renderer: TrueRenderer | None = None
        self._rendered: list[int] = []  # whose Gaussians the renderer holds
        self.controls = Controls(server.gui, contents)
        self._connect()
        server.initial_camera.position = FIRST_EYE
        server.initial_camera.look_at = ORIGIN
        server.scene.set_up_direction("+z")
        self._add_still_nodes()
        self.show_gaussians()
        self.arrange()
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._farewell)

    def arrange(self) -> None:
        """Put the chosen contents side by side, or one of them alone in the middle."""
        with self._changing:
            numbers = self.controls.numbers
            for number, offset in zip(numbers, side_by_side(len(numbers)), strict=True):
                self._placements[number] = self._placements[number].at(offset)
                self._stands[number].position = offset
            if self.controls.box is None:
                self._renderer = None
                self.show_what_is_chosen()
            else:  # the box stays where it is, and cuts other parts
                self.show_gaussians()

    def show_gaussians(self) -> None:
        """Put the Gaussians of the chosen stage into the scene; what the box cuts off is left out."""
        with self._changing:
            self._renderer = None
            for number in range(len(self._contents)):
                self._replace_gaussians(number)
            self.show_what_is_chosen()

    @property
    def has_visitors(self) -> bool:
        """Whether a browser is looking."""
        return bool(self._streamers)

    def replace_stage(self, stage: Stage) -> None:
        """Show other Gaussians as the only stage of the first contents."""
        with self._changing:
            self._contents[0] = replace(self._contents[0], stages=(stage,))
            self.controls.label.value = stage.label
            self.show_gaussians()

    def show_what_is_chosen(self) -> None:
        """Show and hide the nodes as the switches say, and draw the background again."""
        with self._changing:
            true_render = self.controls.true_render is not None
            for (number, layer), handles in self._nodes.items():
                visible = self.controls.shows(number, layer)
                visible &= not (true_render and layer == nodes.GAUSSIANS)
                for handle in handles:
                    handle.visible = visible
            for streamer in list(self._streamers.values()):  # browsers come and go meanwhile
                streamer.update()

    def save(self, target: Path) -> str:
        """Save the Gaussians of the first contents that are shown, in their world; return what was done."""
        chosen = self.controls.numbers
        number = next((n for n in chosen if self._contents[n].stages), None)
        world = None if number is None else self._world_gaussians(number)
        if number is None or world is None:
            return "Not saved: what is shown has no Gaussians."
        box = self.controls.box
        page = self._placements[number].points(world.means)
        keep = np.ones(len(world), dtype=bool) if box is None else box.holds(page)
        try:
            return save_cropped(target, world, keep, self._contents[number].name)
        except (DigsError, OSError) as error:
            logger.warning("not saved: %s", error)
            return f"Not saved: {error}"

    def end(self) -> None:
        """Stop what runs for the browsers."""
        for streamer in list(self._streamers.values()):
            streamer.end()

    def _connect(self) -> None:
        controls = self.controls
        controls.on_stage(self.show_gaussians)
        controls.on_standing(self.arrange)
        controls.on_choice(self.show_what_is_chosen)
        controls.on_pictures(self._replace_cameras)
        controls.on_crop(self.show_gaussians)
        controls.on_save(self.save)

    def _add_still_nodes(self) -> None:
        scene = self._server.scene
        for number, each in enumerate(self._contents):
            placement = self._placements[number].at(ORIGIN)
            for layer, cloud in each.points.items():
                handle = nodes.add_points(scene, _name(number, layer), cloud, placement)
                self._nodes[number, layer] = [handle]
            for layer, mesh in each.meshes.items():
                handle = nodes.add_mesh(scene, _name(number, layer), mesh, placement)
                self._nodes[number, layer] = [handle]
        self._replace_cameras()

    def _replace_cameras(self) -> None:
        with self._changing:
            for number, each in enumerate(self._contents):
                if not each.frames:
                    continue
                for handle in self._nodes.pop((number, nodes.CAMERAS), []):
                    handle.remove()
                self._nodes[number, nodes.CAMERAS] = nodes.add_cameras(
                    self._server.scene,
                    _name(number, nodes.CAMERAS),
                    each.frames,
                    self.controls.pictures,
                    self._placements[number].at(ORIGIN),
                    partial(self._go_to, number),
                )
            self.show_what_is_chosen()

    def _replace_gaussians(self, number: int) -> None:
        for handle in self._nodes.pop((number, nodes.GAUSSIANS), []):
            handle.remove()
        page = self._page_gaussians(number)
        if page is not None:
            offset = self._placements[number].offset.astype(np.float32)
            here = replace(page, means=page.means - offset)
            name = _name(number, nodes.GAUSSIANS)
            self._nodes[number, nodes.GAUSSIANS] = [
                nodes.add_gaussians(self._server.scene, name, here)
            ]

    def _world_gaussians(self, number: int) -> Gaussians | None:
        """Return the Gaussians of the chosen stage; None where there are none."""
        stages = self._contents[number].stages
        return stages[self.controls.stage_of(len(stages))].gaussians if stages else None

    def _page_gaussians(self, number: int) -> Gaussians | None:
        """Return those that are shown, on the page; None where there are none."""
        world = self._world_gaussians(number)
        if world is None:
            return None
        page = self._placements[number].gaussians(world)
        box = self.controls.box
        page = page if box is None else page.select(box.holds(page.means))
        return page if len(page) else None

    def _asked(self) -> tuple[TrueRenderer, Shown] | None:
        """Return what the background shows; None: nothing."""
        with self._changing:
            shown = self.controls.true_render
            if shown is None:
                return None
            everyone = range(len(self._contents))
            numbers = [n for n in everyone if self.controls.shows(n, nodes.GAUSSIANS)]
            if self._renderer is None or self._rendered != numbers:
                found = [page for n in numbers if (page := self._page_gaussians(n)) is not None]
                self._renderer = TrueRenderer(_together(found)) if found else None
                self._rendered = numbers
            return (self._renderer, shown) if self._renderer else None

    def _go_to(self, number: int, client: "viser.ClientHandle", frame: Frame) -> None:
        """Move a browser's camera to where a photograph was taken."""
        k, pose = frame.camera.intrinsics, frame.camera.world_from_cam
        with client.atomic():
            client.camera.wxyz = np.roll(quat_xyzw_from_matrix(pose[:3, :3]), 1)
            client.camera.position = self._placements[number].points(pose[None, :3, 3])[0]
            client.camera.fov = 2.0 * float(np.arctan(0.5 * k.height / k.fy))

    def _welcome(self, client: "viser.ClientHandle") -> None:
        self._streamers[client.client_id] = Streamer(client, self._asked)

    def _farewell(self, client: "viser.ClientHandle") -> None:
        streamer = self._streamers.pop(client.client_id, None)
        if streamer is not None:
            streamer.end()


def _together(sets: Sequence[Gaussians]) -> Gaussians:
    """Return all Gaussians; those for different renderers are drawn without a filter on the screen."""
    if len({each.screen_filter for each in sets}) > 1:
        logger.warning(
            "side by side, splats for different renderers are all drawn without dilation; alone, as meant"
        )
        sets = [replace(each, screen_filter=NO_FILTER) for each in sets]
    return joined(sets)


def _placed(contents: Sequence[Contents]) -> list[Placement]:
    """Return where each stands; all results of a recording have one scale, so that they can be compared."""
    found: dict[Path, Placement] = {}
    placements = []
    for each in contents:
        placement = Placement.of(each.world_points())
        if each.recording is not None:
            placement = found.setdefault(each.recording, placement)
        placements.append(placement)
    return placements


def _name(number: int, layer: str) -> str:
    return f"/{number}/{layer.replace(' ', '_')}"
