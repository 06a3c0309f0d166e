"""The training loop: it learns, survives odd views and crops, and says when it cannot go on."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import FIELDS, Gaussians, joined
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import PixelBox, look_at
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import ViewStore, open_views, view_index
from digs_warp.train.views import View, packed_view
from reference.tiny_capture import RADIUS, ball
from reference.trained_ball import trained


def test_the_background_supervises_the_outside(capture: Capture) -> None:
    """Its color changes, so that stray Gaussians of any color vanish."""
    stray = ball(count=60)
    stray = replace(stray, means=stray.means * 1.7, sh=np.full_like(stray.sh, 1.7724))  # white
    config = TrainConfig(stop=Stop(iterations=120), sh_degree=0)
    found = trained(capture.frames, config, joined([ball(), stray])).gaussians.to_numpy()
    outside = np.linalg.norm(found.means, axis=1) > 1.4 * RADIUS
    assert outside.any() and np.median(found.opacities[outside]) < 0.5


def test_every_view_is_seen_once_an_epoch() -> None:
    seen = [view_index(0, 8, step) for step in range(16)]
    assert sorted(seen[:8]) == sorted(seen[8:]) == list(range(8))
    assert seen[:8] not in (seen[8:], [view_index(1, 8, step) for step in range(8)])


def test_no_gaussians_and_no_views_are_refused(capture: Capture) -> None:
    config = TrainConfig()
    nothing = Gaussians(*(getattr(ball(), name)[:0] for name in FIELDS))
    with pytest.raises(DigsError, match="no Gaussians"):
        Trainer(nothing, open_views(capture.frames, config), config)
    with pytest.raises(DigsError, match="no training views"):
        open_views([], config)


def camera(number: int, width: int = 40, height: int = 30) -> Camera:
    angle = 0.7 * number
    eye = 0.9 * np.array([np.cos(angle), np.sin(angle), 0.4])
    world_from_cam = look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    return Camera(Intrinsics.from_fov(width, height, 40.0), world_from_cam)


def store(views: list[View]) -> ViewStore:
    """The views, as if they had been read from files."""
    frames = [Frame(view.name, view.camera, 0.0, {}) for view in views]
    by_name = {view.name: view for view in views}
    return ViewStore(
        frames, lambda step: view_index(0, len(views), step), lambda f: by_name[f.name], 100.0
    )


def loss_and_gradients(
    seeds: Gaussians, view: View, background: np.ndarray, content: PixelBox | None = None
) -> tuple[np.ndarray, float, Gaussians]:
    """The image, drawn over NaN, the loss, and its gradients."""
    trainer = Trainer(seeds, store([view]), TrainConfig())
    renderer, (width, height) = trainer.renderer, view.size
    renderer.image.assign(np.full((height, width, 3), np.nan))
    renderer.transmittance.assign(np.full((height, width), np.nan))
    renderer.forward(view.camera, near=0.01, background=background, content=content)
    trainer.objective.compare(view, background)
    renderer.backward()
    return renderer.image.to_numpy(), trainer.loss_value(), renderer.gradients.to_numpy()


def test_the_crop_changes_no_gradient() -> None:
    """A view cropped to its mask, and the same one kept whole, give the same loss and gradients."""
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (70, 200, 3), dtype=np.uint8)
    mask = np.zeros((70, 200), np.uint8)
    mask[25:44, 70:97] = rng.integers(1, 256, (19, 27))
    cropped = packed_view("0", camera(0, 200, 70), image, mask)
    marked = mask.copy()
    marked[0, 0] = marked[-1, -1] = 1  # two nearly transparent pixels make the box the whole image
    image[0, 0] = image[-1, -1] = 0
    whole = packed_view("0", camera(0, 200, 70), image, marked)
    assert cropped.box == (70, 25, 97, 44) and whole.box == (0, 0, 200, 70)
    seeds = ball(200)
    seeds = replace(seeds, means=seeds.means * 2.5)
    black = np.zeros(3)  # as the two pixels are
    results = [loss_and_gradients(seeds, view, black)[1:] for view in (cropped, whole)]
    assert results[0][0] == pytest.approx(results[1][0], rel=1e-5)
    for name in FIELDS:
        one, other = (getattr(gradients, name) for _, gradients in results)
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-6 * np.abs(other).max())
        assert np.abs(one).max() > 0


@pytest.mark.parametrize(("left", "drawn"), [(0, True), (190, False)])
def test_the_loss_reads_nothing_that_is_not_drawn(left: int, drawn: bool) -> None:
    """Tiles far from the object and from splats are left alone: whatever they hold, the loss is the same."""
    width, height = 600, 260
    mask = np.zeros((height, width), np.uint8)
    mask[110:150, left : left + 40] = 255
    view = packed_view(
        "0", camera(0, width, height), np.full((height, width, 3), 90, np.uint8), mask
    )
    seeds = ball(50)
    seeds = replace(seeds, means=0.1 * seeds.means + (0.0 if drawn else 100.0))
    results = []
    for content in (None, view.box):
        image, *found = loss_and_gradients(seeds, view, np.array([0.9, 0.2, 0.4]), content)
        assert np.isnan(image).any() == (content is not None)
        results.append(found)
    assert results[0][0] == results[1][0] > 0
    for name in FIELDS:
        whole, part = (getattr(gradients, name) for _, gradients in results)
        np.testing.assert_array_equal(whole, part)
