"""Whether lengths are in metres: unknown without depth, unless the recorder says so."""

from dataclasses import replace
from pathlib import Path

import digs_warp as dw
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.files import read_json
from digs_warp.show.report.facts import describe
from digs_warp.show.report.run_section import figures_section


def without_depth(capture: Capture) -> Capture:
    frames = tuple(frame.without_layer(Layer.DEPTH) for frame in capture.frames)
    return replace(capture, frames=frames)


def test_an_unknown_scale_is_said_everywhere(tiny_capture: Capture, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = dw.reconstruct(without_depth(tiny_capture), out, iterations=5, sh_degree=0)
    assert result.poses.metric_scale is not None and not result.poses.metric_scale.known
    assert (
        read_json(out / "run.json", "record")["results"]["poses"]["metric_scale"]["known"] is False
    )
    facts = describe(out)
    assert facts["scale"].startswith("unknown: the recording has no depth")
    assert facts["extent"].endswith(" units")
    loaded = Reconstruction.load(out)
    assert loaded.poses.metric_scale == result.poses.metric_scale
    assert "unknown: the recording has no depth" in figures_section(loaded)
    loaded.save_usd(tmp_path / "scene.usda")
    assert "scale unknown" in describe(tmp_path / "scene.usda")["axes and unit"]
