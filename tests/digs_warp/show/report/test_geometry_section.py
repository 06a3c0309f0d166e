"""Depth in the report: the figures are those of a surface and a sensor that we know."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.geometry_section import depth_errors, geometry_section
from reference.report_folder import write_capture
from reference.tiny_capture import RADIUS, ball, write_tiny_capture


def figures(result: Reconstruction, posed: PosedFrames, name: str) -> list[float]:
    """The median, the median size and the 90th percentile of differences [mm]."""
    errors = {each.label: each.values for each in depth_errors(result, posed.training)}
    return [np.median(errors[name]), *np.percentile(np.abs(errors[name]), [50, 90])]


def test_the_surface_is_compared_with_the_depth(tmp_path: Path) -> None:
    posed = PosedFrames.as_recorded(write_tiny_capture(tmp_path / "capture"))
    right = figures(Reconstruction(gaussians=ball()), posed, "surface - measured")
    shrunk = Reconstruction(gaussians=replace(ball(), means=ball().means * (1 - 0.02 / RADIUS)))
    behind = figures(shrunk, posed, "surface - measured")
    html = geometry_section(shrunk, posed)
    # 20 mm along the radius are 20 mm in the middle of the image, and more towards the rim.
    assert 20 < behind[0] - right[0] < 28
    assert behind[1] <= behind[2]
    assert "measured - true" not in html and "surface - true" not in html


def test_without_depth_there_is_no_chart(tmp_path: Path) -> None:
    tiny = write_tiny_capture(tmp_path / "capture")
    blind = replace(tiny, frames=tuple(f.without_layer(Layer.DEPTH) for f in tiny.frames))
    html = geometry_section(Reconstruction(gaussians=ball()), PosedFrames.as_recorded(blind))
    assert "<svg" not in html


def test_the_noise_of_a_simulated_sensor_is_told(tmp_path: Path) -> None:
    posed = PosedFrames.as_recorded(write_capture(tmp_path / "capture"))
    result = Reconstruction(gaussians=ball())
    html = geometry_section(result, posed)
    # Normal, of 2 mm: half of it is below 0.6745 sigma, 90 % below 1.645 sigma.
    expected = (0.0, 1.349, 3.29)
    np.testing.assert_allclose(figures(result, posed, "measured - true"), expected, atol=0.15)
    assert "surface - true" in html
    # The curves differ in more than their color.
    assert len(set(re.findall(r'stroke-dasharray="([^"]+)"', html))) >= 2
