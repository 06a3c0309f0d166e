"""The rendered surface against a true one: a ball of Gaussians and a sphere."""

import numpy as np
import pytest
import trimesh

from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.splat.config import REACH
from digs_warp.surface.rendered import surface_error
from reference.tiny_capture import RADIUS, ball, write_tiny_capture


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("tiny") / "capture", frames=6)


def sphere(radius: float) -> TriangleMesh:
    mesh = trimesh.creation.icosphere(4, radius)
    return TriangleMesh(mesh.vertices, mesh.faces, np.ones_like(mesh.vertices))


def test_finds_a_true_surface_that_is_larger(capture: Capture) -> None:
    # The skins of its splats, 12 mm wide, lie in front of their centers.
    skin = RADIUS + REACH * 0.012
    exact = surface_error(ball(), capture.frames, sphere(skin))
    larger = surface_error(ball(), capture.frames, sphere(skin + 0.1))
    assert exact is not None and larger is not None
    # They also overlap: the nearer of them show first.
    assert exact.accuracy < 0.012
    assert larger.accuracy == pytest.approx(0.1, abs=0.012)
    assert larger.completeness > exact.completeness + 0.05
    beside = sphere(skin)
    beside = TriangleMesh(beside.points_world + [0.1, 0, 0], beside.triangles, beside.colors)
    error = surface_error(ball(), capture.frames, beside)
    assert error is not None and error.accuracy == pytest.approx(0.05, abs=0.012)  # mean |cos|


def test_what_no_camera_saw_is_missing_from_the_whole_alone(capture: Capture) -> None:
    skin = sphere(RADIUS + REACH * 0.012)
    # A second sphere inside the first: nobody can see it.
    inner = sphere(0.5 * RADIUS)
    corners = np.concatenate([skin.points_world, inner.points_world])
    faces = np.concatenate([skin.triangles, inner.triangles + len(skin.points_world)])
    both = TriangleMesh(corners, faces, np.ones_like(corners))
    alone = surface_error(ball(), capture.frames, skin)
    nested = surface_error(ball(), capture.frames, both)
    assert alone is not None and nested is not None
    assert alone.seen_completeness is not None and nested.seen_completeness is not None
    assert nested.completeness > alone.completeness + 0.05 * RADIUS
    assert nested.seen_completeness == pytest.approx(alone.seen_completeness, rel=0.1)


def test_a_surface_that_no_view_shows_has_no_figures(capture: Capture) -> None:
    faint = ball(50)
    faint = Gaussians(
        faint.means, faint.log_scales, faint.quats, np.full(len(faint), -9.0), faint.sh
    )
    assert surface_error(faint, capture.frames, sphere(RADIUS)) is None
