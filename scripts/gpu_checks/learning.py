"""Loss, optimizer and training: the same on the CPU and on the device."""

import time

import numpy as np
import warp as wp

from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.geometry.camera import Camera
from digs_warp.losses.photometric import PhotometricLoss, similarity_of_strips
from digs_warp.losses.regions import read_region
from digs_warp.losses.target import Target, pack_view
from digs_warp.measure.ssim import BLOCK_COLUMNS, BLOCK_ROWS
from digs_warp.measure.ssim_pixels import similarity_of_pixels
from digs_warp.splat.backend import RasterBackend
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from digs_warp.train.optimizer import Adam
from digs_warp.train.rates import DENSE_RATES
from gpu_checks.parts import Findings, Run, relative
from gpu_checks.scenes import EXTENT, NEAR, body_in_room, cameras, perturbed

VIEWS = 8
WHITE = np.ones(3)

# Means of float32 terms, summed in another order.
MOST_LOSS = 1e-5  # relative
MOST_LOSS_GRADIENT = 1e-4  # |difference| / |gradient|
# One update is a few operations; ten of them add their rounding.
MOST_UPDATE = 1e-4  # |difference| / |change|
# Adam's first steps do not depend on the size of a gradient, only on its sign: gradients near zero go other
# ways, and two trainings drift apart. They have to arrive at the same quality. (Centers moved by 1e-6 m at
# the start: 42.96 to 43.01 dB after 300 steps.)
MOST_PSNR_APART = 0.15  # dB
LEAST_GAIN = 0.03  # dB a step over the start, but
MOST_LEAST_GAIN = 10.0  # dB are enough


class Training:
    """A training of splats against views, without masks, as `digs_warp.train.trainer` does it.

    Args:
        start: the splats.
        views: cameras of one size.
        photographs: what they show, (height, width, 3), uint8.
        device: Warp device.
        steps: along which the rates fall.
        backend: which kernels draw. Default: those for the device.
    """

    def __init__(
        self,
        start: Gaussians,
        views: list[Camera],
        photographs: list[np.ndarray],
        device: str,
        steps: int,
        backend: RasterBackend | None = None,
    ) -> None:
        self.device, self.cameras = device, views
        self.gaussians = DeviceGaussians.from_numpy(start, device)
        k = views[0].intrinsics
        self.size = k.width, k.height
        self.renderer = SplatRenderer(self.gaussians, *self.size, backend=backend)
        self.target = Target(*self.size, device)
        image = self.renderer.image
        self.loss = PhotometricLoss(image, self.target.image, self.renderer.adj_image)
        gradients = self.renderer.gradients
        self.optimizer, self._steps = Adam(self.gaussians, gradients, DENSE_RATES, EXTENT), steps
        full = np.full((k.height, k.width), 255, dtype=np.uint8)
        self._pixels = [
            wp.array(pack_view(photograph, full), dtype=wp.uint8, device=device)
            for photograph in photographs
        ]
        self._blocks = all_blocks(*self.size)

    def draw(self, number: int) -> None:
        """Draw a view."""
        self.renderer.forward(self.cameras[number], near=NEAR, background=WHITE)

    def compose(self, number: int) -> None:
        """Fill the target."""
        region = read_region(self._blocks, self.size)
        box = (0, 0, *self.size)
        self.target.compose(self._pixels[number], box, WHITE, region, self.size)

    def compare(self) -> None:
        """Compute the loss and its gradient."""
        self.loss.run(self.size, self._blocks)

    def step(self) -> None:
        """Take one step, on one view after the other."""
        number = self.optimizer.step % len(self.cameras)
        self.draw(number)
        self.compose(number)
        self.compare()
        self.renderer.backward()
        self.optimizer.update(self.optimizer.step / self._steps)

    def quality(self) -> float:
        """Return the mean PSNR of all views [dB]."""
        found = []
        for number in range(len(self.cameras)):
            self.draw(number)
            self.compose(number)
            difference = self.renderer.image.to_numpy() - self.target.image.to_numpy()
            found.append(-10.0 * np.log10(np.mean(np.square(difference, dtype=np.float64))))
        return float(np.mean(found))


def make_training(
    run: Run, device: str, backend: RasterBackend | None, count: int, size: tuple[int, int]
) -> Training:
    """Return a training of ``count`` splats whose photographs are drawn by the CPU."""
    scene = body_in_room(count)
    views = cameras(VIEWS, *size)
    artist = SplatRenderer(DeviceGaussians.from_numpy(scene), *size)
    photographs = []
    for camera in views:
        artist.forward(camera, near=NEAR)
        photographs.append((255.0 * np.clip(artist.image.to_numpy(), 0, 1) + 0.5).astype(np.uint8))
    return Training(perturbed(scene), views, photographs, device, run.steps, backend)


def all_blocks(width: int, height: int) -> np.ndarray:
    """Return all blocks of the loss, bool."""
    return np.ones((-(-height // BLOCK_ROWS), -(-width // BLOCK_COLUMNS)), dtype=bool)


def ssim(run: Run, findings: Findings) -> None:
    """Compare L1 + SSIM and its gradient."""
    rng = np.random.default_rng(5)
    size = run.width, run.height
    shape = run.height, run.width
    shown = rng.uniform(size=(*shape, 3)).cumsum(axis=1) % 1.0
    wanted = np.clip(shown + 0.2 * rng.normal(size=shown.shape), 0, 1)
    found = []
    for device, kernels in (("cpu", similarity_of_strips), (run.device, similarity_of_pixels)):
        image, target = (ImagePlanes.of(x, device) for x in (shown, wanted))
        adjoint = ImagePlanes(*size, 3, device)
        loss = PhotometricLoss(image, target, adjoint, similarity=kernels)
        loss.run(size, all_blocks(*size))
        found.append((loss.value(), adjoint.to_numpy()))
    (expected, gradient), (value, tried) = found
    findings.at_most("loss", abs(value - expected) / expected, MOST_LOSS)
    findings.at_most("gradient", relative(tried, gradient), MOST_LOSS_GRADIENT)


def adam(run: Run, findings: Findings) -> None:
    """Compare the parameters after one and after ten updates with the same gradients."""
    rng = np.random.default_rng(7)
    start = body_in_room(run.splats)
    gradients = Gaussians(**{name: rng.normal(size=getattr(start, name).shape) for name in FIELDS})
    found = {}
    for device in ("cpu", run.device):
        gaussians = DeviceGaussians.from_numpy(start, device)
        given = DeviceGaussians.from_numpy(gradients, device)
        optimizer = Adam(gaussians, given, DENSE_RATES, EXTENT)
        for update in range(1, 11):
            optimizer.update((update - 1) / 20)
            if update in (1, 10):
                found[device, update] = gaussians.to_numpy()
        findings.require(f"{device}: all are finite", optimizer.is_finite)
    for update in (1, 10):
        expected, tried = (found[device, update] for device in ("cpu", run.device))
        differences = {}
        for name in FIELDS:
            before = getattr(start, name)
            change = getattr(expected, name) - before
            differences[name] = relative(getattr(tried, name) - before, change)
        findings.all_at_most(f"after update {update}", differences, MOST_UPDATE)


def training(run: Run, findings: Findings) -> None:
    """Train on the CPU and on the device from the same start; compare the losses and the quality."""
    qualities = []
    for device, backend in (("cpu", None), (run.device, run.backend)):
        place = "CPU" if backend is None and device == "cpu" else f"{device}, kernels for CUDA"
        job = make_training(run, device, backend, run.splats, (run.width, run.height))
        before = job.quality()
        losses, start = [], time.perf_counter()
        for step in range(run.steps):
            job.step()
            if step % max(1, run.steps // 10) == 0:
                losses.append(round(job.loss.value(), 5))
        wp.synchronize()
        seconds = time.perf_counter() - start
        qualities.append(job.quality())
        findings.note(f"{place}: loss during the training", losses)
        findings.note(f"{place}: PSNR before [dB]", before)
        least = min(LEAST_GAIN * run.steps, MOST_LEAST_GAIN)
        findings.at_least(f"{place}: PSNR gained [dB]", qualities[-1] - before, least)
        findings.note(f"{place}: PSNR after [dB]", qualities[-1])
        findings.note(f"{place}: steps per second", run.steps / seconds)
        findings.require(f"{place}: all are finite", job.optimizer.is_finite)
    apart = abs(qualities[1] - qualities[0])
    findings.at_most("PSNR apart [dB]", apart, MOST_PSNR_APART)


def determinism(run: Run, findings: Findings) -> None:
    """Train twice on the device: the results have the same bits."""
    results = []
    for _ in range(2):
        job = make_training(run, run.device, run.backend, run.splats, (run.width, run.height))
        for _ in range(min(run.steps, 30)):
            job.step()
        results.append(job.gaussians.to_numpy())
    differences = {}
    for name in FIELDS:
        first, second = (getattr(result, name) for result in results)
        differences[name] = float(np.abs(first - second).max())
    findings.all_at_most("two trainings", differences, 0.0)
