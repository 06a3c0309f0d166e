"""Forward and backward: the same views on the CPU and on the device."""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.gaussians import FIELDS
from digs_warp.geometry.camera import Camera
from digs_warp.splat.backend import RasterBackend, VectorizedBackend
from digs_warp.splat.blur_renderer import BlurRenderer
from digs_warp.splat.camera_motion import STILL, Blur, RowMotion
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.splat.renderer import SplatRenderer
from gpu_checks.parts import Findings, Run, relative, say
from gpu_checks.scenes import NEAR, body_in_room, cameras, filtered

# Both sides compute in float32 and round at other places, by about 1e-6 of a color. Where an alpha is just
# at the cut of 1/255, that decides what is drawn: such a pixel may differ by a step of the cut or more. There
# are few of them, so the bounds are on means and on shares of pixels. Rounding also decides which of two
# splats comes first whose depths differ by a few units in the last place, and one such pair can fill a
# thousandth of the image: the CPU draws in the order of the device's depths, and these are compared, too.
MOST_DEPTH = 5e-6  # [m]; a depth is the sum of terms of up to 8 m, of which each is rounded to 5e-7
MOST_RMS = 1e-4  # 80 dB
VISIBLE = 1e-3  # a quarter of a step of 8 bits
MOST_VISIBLE = 1e-3  # share of the pixels
# Sums over thousands of pixels with random signs, those at the cut among them: much of them cancels.
MOST_GRADIENT = 2e-3  # |difference| / |gradient|

BACKGROUND = (0.2, 0.5, 0.9)


@dataclass(frozen=True)
class Case:
    """A view that is drawn on both.

    Attributes:
        name: of the case.
        options: how it is drawn.
        rows: how the camera moves while the rows are read.
        blur: how it moves while the shutter is open.
    """

    name: str
    options: RasterOptions
    rows: RowMotion = STILL
    blur: Blur | None = None


_MOTION = RowMotion(np.array([0.02, -0.03, 0.05]), np.array([0.04, -0.02, 0.03]))
CASES = (
    Case("color", RasterOptions()),
    Case("antialias", RasterOptions(antialias=True)),
    Case("mean depth", RasterOptions(outputs="mean depth")),
    Case("skin depth", RasterOptions(outputs="depth", depth_of="skin")),
    Case("rolling shutter", RasterOptions(outputs="depth"), rows=_MOTION),
    Case("blur", RasterOptions(), blur=Blur(_MOTION, pixels=3.0)),
)

Renderer = SplatRenderer | BlurRenderer


class Views:
    """A case, drawn on the CPU and on the device."""

    def __init__(self, run: Run, case: Case, camera: Camera) -> None:
        self.case, self.camera = case, camera
        self.scene = filtered(body_in_room(run.splats), camera)
        self.cpu = self._renderer("cpu", VectorizedBackend())
        self.tried = self._renderer(run.device, run.backend)
        for renderer in (self.cpu, self.tried):
            device = renderer.gaussians.device
            renderer.statistics = SplatStatistics.zeros(run.splats, device)
            motions = {"rows": case.rows}
            if case.blur is not None:
                motions = {"blur": case.blur}
            renderer.forward(camera, near=NEAR, background=BACKGROUND, **motions)  # pyright: ignore[reportArgumentType]
        self.depth_apart, self.moved = 0.0, 0
        if isinstance(self.cpu, SplatRenderer) and isinstance(self.tried, SplatRenderer):
            self.depth_apart, self.moved = take_order(self.cpu, self.tried)

    def images(self, renderer: Renderer) -> dict[str, np.ndarray]:
        """Return what was drawn by name, each (height, width, channels)."""
        found = {"color": renderer.image, "transmittance": renderer.transmittance}
        depths = renderer if isinstance(renderer, SplatRenderer) else renderer.middle
        found["depth"] = depths.depth
        return {name: planes.to_numpy() for name, planes in found.items() if planes.channels}

    def gradients(self, renderer: Renderer) -> dict[str, np.ndarray]:
        """Pull random gradients of the images back; return those of all inputs, and the statistics."""
        rng = np.random.default_rng(3)
        size = self.camera.intrinsics.height, self.camera.intrinsics.width
        planes = [renderer.adj_image, renderer.adj_transmittance]
        if isinstance(renderer, SplatRenderer):
            planes.append(renderer.adj_depth)
        for adjoint in planes:
            if adjoint.channels:
                adjoint.assign(rng.normal(size=(*size, adjoint.channels)) / size[0] / size[1])
        renderer.backward()
        arrays = zip(FIELDS, renderer.gradients.arrays, strict=True)
        found = {name: array.numpy().copy() for name, array in arrays}
        for name, array in vars(renderer.statistics).items():
            found[f"statistics: {name}"] = array.numpy().copy()
        return found

    def _renderer(self, device: str, backend: RasterBackend | None) -> Renderer:
        gaussians = DeviceGaussians.from_numpy(self.scene, device)
        k, case = self.camera.intrinsics, self.case
        if case.blur is not None:
            moments = case.blur.moments
            return BlurRenderer(gaussians, k.width, k.height, options=case.options, moments=moments)
        return SplatRenderer(gaussians, k.width, k.height, options=case.options, backend=backend)


def take_order(renderer: SplatRenderer, other: SplatRenderer) -> tuple[float, int]:
    """Draw the last view again in the order of the other's depths.

    Returns:
        How far the depths by which they sort are apart [m], and how many places in the lists of the tiles
        have another splat now.

    Raises:
        ValueError: the lists of the first, made again from its own depths, are not the same.
    """
    lists, stages = renderer.binner.lists, renderer.stages()
    before = lists.pairs.numpy()[:, 0].copy()
    own, others = (each.binner.lists.centers.numpy().copy() for each in (renderer, other))
    pairs = renderer.binner.total_pairs
    stages["bin"]()
    if not np.array_equal(lists.pairs.numpy()[:pairs, 0], before[:pairs]):
        raise ValueError("the tile lists of the CPU differ when they are made again")
    both = (own > 0) & (others > 0)
    lists.centers.assign(np.where(both, others, own))
    stages["bin"]()
    stages["forward"]()
    moved = int((lists.pairs.numpy()[:pairs, 0] != before[:pairs]).sum())
    return float(np.abs(own - others)[both].max(initial=0.0)), moved


def all_views(run: Run) -> list[tuple[Case, Camera]]:
    """Return all cases, each seen from elsewhere; blur has kernels for CUDA only there."""
    cases = [case for case in CASES if run.has_gpu or case.blur is None]
    return list(zip(cases, cameras(len(cases), run.width, run.height), strict=True))


def forward(run: Run, findings: Findings) -> None:
    """Compare all images of all cases."""
    for case, camera in all_views(run):

        def compare(case: Case = case, camera: Camera = camera) -> None:
            views = Views(run, case, camera)
            findings.at_most(f"{case.name}: depths apart [m]", views.depth_apart, MOST_DEPTH)
            findings.note(f"{case.name}: pairs in another order", views.moved)
            expected = views.images(views.cpu)
            for name, found in views.images(views.tried).items():
                compare_images(f"{case.name}: {name}", found, expected[name], findings)

        findings.attempt(case.name, compare)


def backward(run: Run, findings: Findings) -> None:
    """Compare all gradients of all cases."""
    for case, camera in all_views(run):

        def compare(case: Case = case, camera: Camera = camera) -> None:
            views = Views(run, case, camera)
            expected = views.gradients(views.cpu)
            found = views.gradients(views.tried)
            differences = {name: relative(found[name], expected[name]) for name in expected}
            findings.all_at_most(case.name, differences, MOST_GRADIENT)

        findings.attempt(case.name, compare)


def compare_images(name: str, found: np.ndarray, expected: np.ndarray, findings: Findings) -> None:
    """Compare two images, (height, width, channels); differences of depths are shares of these."""
    difference = np.abs(found - expected) / np.maximum(np.abs(expected), 1.0)
    rms = float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))
    largest, visible = difference.max(initial=0.0), (~(difference.max(axis=2) <= VISIBLE)).mean()
    psnr = -20.0 * np.log10(max(rms, 1e-12))
    say(
        f"  {name}: RMS {rms:.2g} ({psnr:.0f} dB), largest {largest:.2g}, "
        f"{visible:.2g} of the pixels above {VISIBLE:g}"
    )
    findings.note(f"{name}: largest difference", float(largest), aloud=False)
    findings.at_most(f"{name}: RMS difference", rms, MOST_RMS, aloud=False)
    findings.at_most(f"{name}: share of visible pixels", visible, MOST_VISIBLE, aloud=False)
