"""A scene that is rendered once and sensed at any strength, for the benchmarks of the initialization."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.rig import Rig
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.measure.surface_metrics import SurfaceScore, surface_score
from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker, RenderedFrame
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import make_plan
from digs_warp.sim.record.session import prepare_session

# Points within this distance [m] of the true surface count as on it.
THRESHOLD = 0.005


@dataclass(frozen=True, eq=False)
class InitCase:
    """A rendered walk round an object whose surface is known.

    Attributes:
        name: of the object.
        folder: where the captures of the strengths go.
        maker: renders frames and senses them.
        rendered: the frames before the sensor.
        surface: the true surface, in the world of the captures.
    """

    name: str
    folder: Path
    maker: FrameMaker
    rendered: list[RenderedFrame]
    surface: TriangleMesh
    _captures: dict[str, Capture] = field(default_factory=dict)

    @property
    def focal_baseline(self) -> float:
        """Focal length [px] times baseline [m]."""
        return float(self.rendered[0].truth.rig.focal_baseline)

    def capture(self, strength: float = 1.0) -> Capture:
        """Return the capture at a strength of the sensor's errors; written when first asked for."""
        maker = self._maker(strength=strength)
        return self._written(f"strength-{strength:g}", lambda r: maker.finish(r, {}))

    def with_depth(self, name: str, change: Callable[[np.ndarray], np.ndarray]) -> Capture:
        """Return a capture without noise whose true depth [m] has been changed."""
        perfect = self._maker(tier="truth")

        def finish(rendered: RenderedFrame) -> FrameImages:
            images = perfect.finish(rendered, {})
            return replace(images, depth=change(rendered.truth.depth))

        return self._written(name, finish)

    def _maker(self, **settings: Any) -> FrameMaker:
        session = self.maker.session
        session = replace(session, config=replace(session.config, **settings))
        return replace(self.maker, session=session)

    def score(self, points_world: np.ndarray) -> SurfaceScore:
        """Return how far points are from the true surface and how much of it they cover."""
        return surface_score(points_world, self.surface, THRESHOLD)

    def _written(self, name: str, finish: Callable[[RenderedFrame], FrameImages]) -> Capture:
        if name not in self._captures:
            session = self.maker.session
            folder = self.folder / self.name / name
            shutil.rmtree(folder, ignore_errors=True)
            rig = Rig(session.rig.baseline)
            writer = CaptureWriter(folder, session.rig.intrinsics, rig)
            for number, rendered in enumerate(self.rendered):
                writer.write_frame(number, finish(rendered))
                pose = rendered.truth.camera.world_from_cam
                writer.add_pose(number, pose, session.moments[number])
            self._captures[name] = writer.finish()
        return self._captures[name]


def render_case(config: SimulateConfig, folder: Path) -> InitCase:
    """Render the frames of a recording; the built-in object is called 'built-in'."""
    session = prepare_session(config, load_inputs(config))
    maker = FrameMaker(session, make_plan(session))
    rendered = []
    with progress(config.frame_count, "Rendering", "frame") as bar:
        for number in range(config.frame_count):
            rendered.append(maker.render(number))
            bar.update()
    scene = session.scene
    surface = TriangleMesh(scene.vertices, scene.faces, np.ones_like(scene.vertices))
    name = config.mesh.stem if config.mesh else "built-in"
    return InitCase(name, folder, maker, rendered, surface)


def training_frames(capture: Capture) -> list[Frame]:
    """Return the frames that may serve an initialization."""
    return capture.split()[0]
