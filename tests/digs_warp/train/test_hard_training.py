"""What training must survive: odd views, odd images, degenerate Gaussians; and crops that change nothing."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import PixelBox, look_at
from digs_warp.train.config import TrainConfig
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import ViewStore, view_index
from digs_warp.train.views import View, packed_view
from reference.tiny_capture import ball


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
