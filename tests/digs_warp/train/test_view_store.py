"""Views of a run: cropped, read ahead, and never more of them in memory than there is room for."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.rigid import mask_box
from digs_warp.train.config import TrainConfig
from digs_warp.train.silhouette import without_surround
from digs_warp.train.view_store import MIN_HELD, ViewStore, open_views, view_index
from digs_warp.train.views import View, load_view
from reference.tiny_capture import HEIGHT, WIDTH, write_tiny_capture


def bounded(capture: Capture, memory: float, loads: list[str]) -> ViewStore:
    def load(frame: Frame) -> View:
        loads.append(frame.name)
        return load_view(frame)

    return ViewStore(capture.frames, lambda step: view_index(3, 8, step), load, memory)


def test_a_view_holds_the_crop_of_its_mask_with_a_clean_rim(capture: Capture) -> None:
    frame = capture.frames[2]
    mask = frame.load_mask()
    mask[mask_box(mask)[1] + 5] //= 2
    frame = frame.with_layer(Layer.MASK, mask)
    view = load_view(frame, with_depth=True)
    x0, y0, x1, y1 = mask_box(frame.load_mask())
    assert view.box == (x0, y0, x1, y1)
    planes = view.pixels.numpy().reshape(4, y1 - y0, x1 - x0)
    photo = without_surround(frame.load_image(), mask)
    assert not np.array_equal(photo, frame.load_image())
    np.testing.assert_array_equal(planes[:3].transpose(1, 2, 0), photo[y0:y1, x0:x1])
    np.testing.assert_array_equal(planes[3], frame.load_mask()[y0:y1, x0:x1])
    assert view.depth is not None
    known = view.depth.weights.numpy() > 0
    expected = frame.load_depth()[y0:y1, x0:x1].ravel()
    np.testing.assert_array_equal(view.depth.depth.numpy()[known], expected[known])
    assert known.sum() > 500
    photograph, depth = 4 * (x1 - x0) * (y1 - y0), 5 * (x1 - x0) * (y1 - y0)
    assert view.depth_samples is not None
    samples = view.samples.bytes + view.depth_samples.bytes
    assert view.bytes == photograph + depth + samples
    assert view.size == (WIDTH, HEIGHT)


@pytest.mark.parametrize("memory", [1e-9, 100.0])
def test_all_views_are_handed_out_and_as_many_held_as_there_is_room_for(
    capture: Capture, memory: float
) -> None:
    loads: list[str] = []
    store = bounded(capture, memory, loads)
    for step in range(24):
        assert store.view(step).name == capture.frames[view_index(3, 8, step)].name
        assert memory > 1 or len(store._held) <= MIN_HELD == store.capacity
    store.close()
    if memory > 1:
        assert sorted(loads) == sorted(frame.name for frame in capture.frames)
    else:
        assert len(loads) > 16  # read again in every epoch


def test_a_broken_image_is_found_before_the_training(capture: Capture, tmp_path: Path) -> None:
    broken = write_tiny_capture(tmp_path / "capture", frames=4)
    broken.frames[2].path(Layer.IMAGE).write_bytes(b"no image")
    with pytest.raises((CaptureError, DigsError), match=r"0002\.png"):
        open_views(read_capture(tmp_path / "capture").frames, TrainConfig())
