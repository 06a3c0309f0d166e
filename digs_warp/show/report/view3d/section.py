"""The section with the 3D view and the film."""

import base64
import json
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.data.viewpoints import evenly
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.markup import figure, picture, section
from digs_warp.show.report.pictures import data_uri
from digs_warp.show.report.shot import FRAME_RATE, Film, Shot, make_film, plan_shot
from digs_warp.show.report.view3d.pack import MOST_BYTES, PackedSplats, pack

SCRIPTS = ("unpack", "orbit", "sort", "draw", "cameras", "controls", "main")

# More pyramids than this hide each other.
MOST_CAMERAS = 120

# How long a camera's pyramid is, as a share of the distance from the cameras to what they look at.
CAMERA_SIZE = 0.06

_HELP = (
    "Turn: drag, or arrow keys. Zoom: two fingers, + and -, or the wheel after a click. Move: Shift while "
    "turning. Back to the start: 0."
)

_LEGEND = (
    "<div class=swatches>"
    '<span><svg viewBox="0 0 24 16" width=24 height=16 fill=none stroke=#1f66b8 stroke-width=1.5>'
    "<path d='M2 8 16 2V14ZM16 2 22 4V12L16 14'/></svg> camera, used in training</span>"
    '<span><svg viewBox="0 0 24 16" width=24 height=16 fill=none stroke=#c25400 stroke-width=1.5>'
    "<path d='M2 8 12 2H22V14H12ZM12 2 22 14M22 2 12 14'/></svg> camera, held out (with a cross)</span>"
    '<span><svg viewBox="0 0 24 16" width=24 height=16 stroke=#6b7380 stroke-width=1.5>'
    "<path d='M2 8H22'/></svg> path from one to the next</span></div>"
)


@dataclass(frozen=True, eq=False)
class View3d:
    """What the section shows; see `start_view`."""

    shot: Shot
    film: Film
    splats: PackedSplats
    by_time: list[tuple[Frame, bool]]


def start_view(result: Reconstruction, posed: PosedFrames, background: Executor) -> View3d:
    """Return what `view_section` needs; its film is encoded in the background meanwhile.

    Args:
        result: with at least one Gaussian.
        posed: the frames with the cameras that were used, at least one.
        background: runs what one core is enough for.
    """
    by_time = posed.by_time
    shot = plan_shot(result, [frame for frame, _ in by_time])
    return View3d(shot, make_film(result, shot, background), pack(result.gaussians), by_time)


def view_section(view: View3d) -> str:
    """Return the section; waits for the film.

    Raises:
        DigsError: the film cannot be written.
    """
    shot, film, splats, by_time = view.shot, view.film, view.splats, view.by_time
    return section(
        "In 3D",
        f"{_kept_words(splats)} Each has one color here, the same from all sides, so nothing shines.",
        "<div class=two>",
        _view(film, shot),
        f"<div>{_film(film, shot)}</div></div>",
        _data("view3d-about", "application/json", _about(splats, shot, by_time)),
        _data("view3d-splats", "text/plain", base64.b64encode(splats.words.tobytes()).decode()),
        f'<script>"use strict";(() => {{\n{_script()}}})();</script>',
    )


def _kept_words(splats: PackedSplats) -> str:
    if len(splats) == splats.total:
        return f"All {splats.total:,} Gaussians."
    share = len(splats) / splats.total
    return (
        f"{len(splats):,} of {splats.total:,} Gaussians, {share:.1%}, those that cover the most: more than "
        f"{MOST_BYTES / 1e6:.0f} MB of them would make this page slow to open. The film and all pictures "
        "show all of them."
    )


def _view(film: Film, shot: Shot) -> str:
    height, width = film.first.shape[:2]
    what = "the object" if shot.is_turn else "the scene"
    still = picture(data_uri(film.first), f"The Gaussians: {what} from one side", width, height)
    return (
        "<div id=view3d><div class=stage>"
        f'{still}<canvas tabindex=0 aria-label="The Gaussians of {what} in 3D; {_HELP}"></canvas></div>'
        "<p class=note role=status>Without JavaScript and WebGL 2, this is a picture.</p>"
        "<div class=tools><button type=button data-key=+>Nearer</button>"
        "<button type=button data-key=->Farther</button>"
        "<button type=button data-key=0>Back to the start</button>"
        f"<label><input type=checkbox> Show the cameras</label></div>{_LEGEND}</div>"
    )


def _film(film: Film, shot: Shot) -> str:
    height, width = film.first.shape[:2]
    words = "One turn around the object" if shot.is_turn else "Along the path of the recording"
    seconds = len(shot.cameras) / FRAME_RATE
    video = (
        f"<video controls loop muted playsinline preload=metadata width={width} height={height} "
        f'aria-label="{words}" poster="{data_uri(film.first)}" src="{film.encoded()}"></video>'
    )
    return figure(video, f"{words}, {seconds:.0f} s, with all Gaussians and their full colors.")


def _about(splats: PackedSplats, shot: Shot, by_time: list[tuple[Frame, bool]]) -> str:
    first = shot.cameras[0]
    k = first.intrinsics
    return json.dumps(
        {
            "help": _HELP,
            "splats": {
                "low": splats.low.tolist(),
                "step": splats.step.tolist(),
                "logLow": splats.log_low,
                "logStep": splats.log_step,
                "dilation": splats.screen_filter.dilation,
                "antialias": splats.screen_filter.antialias,
            },
            "start": {
                "target": shot.target.tolist(),
                "eye": first.center_world.tolist(),
                "up": shot.up.tolist(),
                "halfView": 0.5 * min(k.width, k.height) / k.fx,
            },
            "cameras": _cameras(shot, by_time),
        }
    )


def _cameras(shot: Shot, by_time: list[tuple[Frame, bool]]) -> dict[str, Any]:
    """Return the recorded cameras, and how much farther the view has to be to show them all."""
    eyes = np.array([frame.camera.center_world for frame, _ in by_time])
    away = np.linalg.norm(eyes - shot.target, axis=1)
    first = shot.cameras[0]
    distance = float(np.linalg.norm(first.center_world - shot.target))
    half_view = 0.5 * min(first.intrinsics.width, first.intrinsics.height) / first.intrinsics.fx
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
    named: dict[str, Any] = {"heldOut": held_out}
    for name, column in zip(("right", "down", "forward", "eye"), pose[:3].T, strict=True):
        named[name] = [float(f"{value:.6g}") for value in column]
    return named


def _data(name: str, kind: str, text: str) -> str:
    """Return data for the script; ``<`` would end it early."""
    return f'<script id={name} type="{kind}">{text.replace("<", chr(92) + "u003c")}</script>'


def _script() -> str:
    folder = files("digs_warp.show.report.view3d")
    return "".join((folder / f"{name}.js").read_text("utf-8") for name in SCRIPTS)
