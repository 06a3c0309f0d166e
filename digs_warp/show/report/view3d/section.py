"""The large view in 3D of the report, and what a page has to know of a content to draw it."""

import base64
import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.data.viewpoints import evenly
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.film.camera_path import find_framed_subject
from digs_warp.show.film.video import shoot
from digs_warp.show.report.markup import picture
from digs_warp.show.report.pictures import data_uri
from digs_warp.show.report.view3d.pack import MOST_BYTES, PackedSplats, pack
from digs_warp.show.report.view3d.start import FirstView, around, as_recorded

_SCRIPTS = ("unpack", "orbit", "sort", "draw", "cameras", "controls", "main")

# More pyramids than this hide each other.
MOST_CAMERAS = 120

# How long a camera's pyramid is, as a share of the distance from the cameras to what they look at.
CAMERA_SIZE = 0.06

HELP = (
    "Turn: drag, or arrow keys. Zoom: two fingers, + and -, or the wheel after a click. Move: Shift while "
    "turning. Back: 0. A click on a camera goes there."
)

LEGEND = (
    "<div class=swatches>"
    '<span><svg viewBox="0 0 24 16" width=24 height=16 fill=none stroke=#1f66b8 stroke-width=1.5>'
    "<path d='M2 8 16 2V14ZM16 2 22 4V12L16 14'/></svg> camera, used in training</span>"
    '<span><svg viewBox="0 0 24 16" width=24 height=16 fill=none stroke=#c25400 stroke-width=1.5>'
    "<path d='M2 8 12 2H22V14H12ZM12 2 22 14M22 2 12 14'/></svg> camera, held out (with a cross)</span>"
    '<span><svg viewBox="0 0 24 16" width=24 height=16 stroke=#6b7380 stroke-width=1.5>'
    "<path d='M2 8H22'/></svg> path from one to the next</span></div>"
)

BUTTONS = (
    "<button type=button data-key=+>Nearer</button><button type=button data-key=->Farther</button>"
    "<button type=button data-key=0>Back</button><button type=button name=full>Full screen</button>"
)


def view_section(result: Reconstruction, posed: PosedFrames) -> str:
    """Return the section.

    Args:
        result: with at least one Gaussian.
        posed: the frames with the cameras that were used, at least one.
    """
    first = first_view(result, posed)
    splats = pack(result.gaussians)
    stage = {"label": "", "data": "view3d-splats", **splats.about()}
    content = {
        "start": first.to_json(),
        "cameras": cameras_of(first, posed.by_time),
        "layers": [{"name": "gaussians", "shown": True, "stages": [stage]}],
    }
    about = {"help": f"{_kept_words(splats, result)} {HELP}", "contents": [content]}
    return (
        f"<section id=view3d>{_stage(result, first)}"
        f"<div class=tools>{BUTTONS}"
        f"<label><input type=checkbox name=cameras> Show the cameras</label></div>{LEGEND}"
        "<p class=note role=status>Without JavaScript and WebGL 2, this is a picture.</p></section>"
        f"{data('view3d-about', 'application/json', json.dumps(about))}"
        f"{data('view3d-splats', 'text/plain', base64.b64encode(splats.to_bytes()).decode())}"
    )


def first_view(result: Reconstruction, posed: PosedFrames) -> FirstView:
    """Return where the view of a reconstruction begins; arguments as of `view_section`."""
    recorded = [frame.camera for frame, _ in posed.by_time]
    if result.poses.subject == "scene":
        return as_recorded(result.gaussians.means, recorded)
    return around(find_framed_subject(result.gaussians), recorded)


def _stage(result: Reconstruction, first: FirstView) -> str:
    what = f"the {result.poses.subject}"
    image = next(shoot(result.gaussians, [first.camera], center_world=first.target))
    height, width = image.shape[:2]
    drawn = picture(data_uri(image), f"The Gaussians: {what} from one side", width, height)
    label = f"The Gaussians of {what} in 3D; {HELP}"
    return f'<div class=stage>{drawn}<canvas tabindex=0 aria-label="{label}"></canvas></div>'


def _kept_words(splats: PackedSplats, result: Reconstruction) -> str:
    words = f"All {splats.total:,} Gaussians."
    if len(splats) < splats.total:
        share = len(splats) / splats.total
        words = (
            f"{len(splats):,} of {splats.total:,} Gaussians, {share:.1%}, those that cover the most: more "
            f"than {MOST_BYTES / 1e6:.0f} MB would make this page slow to open."
        )
    if splats.harmonics.shape[1] + 1 < result.gaussians.sh.shape[1]:
        words += " There was no room for all of their gloss."
    return words


def cameras_of(first: FirstView, by_time: Sequence[tuple[Frame, bool]]) -> dict[str, Any]:
    """Return the recorded cameras, held out or not, and how much farther away the view shows them all."""
    eyes = np.array([frame.camera.center_world for frame, _ in by_time])
    away = np.linalg.norm(eyes - first.target, axis=1)
    distance = float(np.linalg.norm(first.camera.center_world - first.target))
    half_view = first.to_json()["halfView"]
    k = by_time[0][0].camera.intrinsics
    return {
        "list": [_camera(frame, held_out) for frame, held_out in evenly(by_time, MOST_CAMERAS)],
        "depth": CAMERA_SIZE * float(np.median(away)),
        "halfWidth": 0.5 * k.width / k.fx,
        "halfHeight": 0.5 * k.height / k.fy,
        "zoom": max(1.0, 1.1 * float(away.max()) / np.sin(np.arctan(half_view)) / distance),
    }


def _camera(frame: Frame, held_out: bool) -> dict[str, Any]:
    pose = frame.camera.world_from_cam
    named: dict[str, Any] = {"name": frame.name, "heldOut": held_out}
    for name, column in zip(("right", "down", "forward", "eye"), pose[:3].T, strict=True):
        named[name] = [float(f"{value:.6g}") for value in column]
    return named


def data(name: str, kind: str, text: str) -> str:
    """Return data for the script; ``<`` would end it early."""
    return f'<script id={name} type="{kind}">{text.replace("<", chr(92) + "u003c")}</script>'


def script(*last: str) -> str:
    """Return the viewer as a script, and after it the named files."""
    folder = files("digs_warp.show.report.view3d")
    text = "".join((folder / f"{name}.js").read_text("utf-8") for name in (*_SCRIPTS, *last))
    return f'<script>"use strict";(() => {{\n{text}}})();</script>'
