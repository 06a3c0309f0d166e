"""What a notebook shows of a recording, a reconstruction, and Gaussians: pictures and a line of facts."""

import html
from collections.abc import Iterable

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.film.camera_path import find_framed_subject, orbit
from digs_warp.show.report.pictures import data_uri
from digs_warp.splat.render import render

# Of a picture [px].
WIDTH = 320
FOV_DEG = 45.0


def capture_card(capture: Capture) -> str:
    """Return the first frame, its depth in gray, and its facts, as HTML."""
    first = capture.frames[0]
    pictures = [first.load_image()]
    if first.has(Layer.DEPTH):
        pictures.append(_gray(first.load_depth()))
    return _card(repr(capture), pictures)


def gaussians_card(gaussians: Gaussians) -> str:
    """Return a view from the side, and the facts, as HTML."""
    if not len(gaussians):
        return _card(repr(gaussians), [])
    k = Intrinsics.from_fov(WIDTH, WIDTH, FOV_DEG)
    return _card(
        repr(gaussians), [_view(gaussians, orbit(find_framed_subject(gaussians), k, 1)[0])]
    )


def reconstruction_card(result: Reconstruction) -> str:
    """Return a held-out photograph, the Gaussians from the same camera, and the verdict, as HTML."""
    if result.frames is None or not result.frames.held_out:
        return gaussians_card(result.gaussians)
    frame = result.frames.held_out[0]
    k = frame.camera.intrinsics
    camera = frame.camera.resized(WIDTH, max(1, round(WIDTH * k.height / k.width)))
    words = f"{result!r} {result.verdict.words}"
    return _card(words, [frame.load_image(), _view(result.gaussians, camera)])


def _view(gaussians: Gaussians, camera: Camera) -> np.ndarray:
    return to_uint8(render(gaussians, camera).image)


def _gray(depth: np.ndarray) -> np.ndarray:
    """Return depth as shades, near ones bright, unknown ones black, (height, width, 3), uint8."""
    known = np.isfinite(depth)
    near, far = np.percentile(depth[known], [1, 99]) if known.any() else (0.0, 1.0)
    shade = 0.1 + 0.9 * np.clip((far - depth) / max(far - near, 1e-6), 0, 1)
    return np.repeat(to_uint8(np.where(known, shade, 0.0))[..., None], 3, axis=2)


def _card(words: str, pictures: Iterable[np.ndarray]) -> str:
    tags = "".join(
        f'<img width="{WIDTH}" style="margin-right:8px" src="{data_uri(np.ascontiguousarray(each))}">'
        for each in pictures
    )
    return f"<div>{tags}<br><small>{html.escape(words)}</small></div>"
