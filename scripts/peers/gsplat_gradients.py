"""Compare our views and gradients with gsplat's PyTorch functions, on the CPU, in one run; print two tables.

    pip install torch==2.13.0 && pip install --no-deps gsplat jaxtyping wadler_lindig rich
    python -m scripts.peers.gsplat_gradients

Of gsplat's PyTorch reference, the projection and the spherical harmonics run on a CPU; its pixels need CUDA
(the lists of pixels per splat and nerfacc's scans have no other version). So the first table takes projection
and colors from gsplat, blends every pixel with every splat in float64 by the formula of 3DGS, and lets
PyTorch differentiate all of it: nothing in it is ours but the blending. The second table times what runs in
both: projection and colors, forward and backward.
"""

import argparse
import sys

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from gsplat.cuda import _torch_impl as gsplat  # pyright: ignore[reportMissingImports]

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.splat.config import DEFAULT_OPTIONS
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer
from studies.results import Result, format_tables
from studies.timing import best_ms

NEAR = 0.2
ROUNDS = 7
FIELDS = ("means", "log_scales", "quats", "opacity_logits", "sh")


def random_gaussians(count: int, rng: np.random.Generator) -> Gaussians:
    """Gaussians of degree 3 that fill the view of `camera`, from needles to balls."""
    depth = rng.uniform(1.0, 3.0, count)
    across = rng.uniform(-0.6, 0.6, (count, 2)) * depth[:, None]
    return Gaussians(
        means=np.column_stack([across, depth]),
        log_scales=rng.uniform(np.log(0.01), np.log(0.1), (count, 3)) - np.log(count / 200) / 2,
        quats=rng.normal(size=(count, 4)),
        opacity_logits=rng.normal(size=count),
        sh=rng.normal(size=(count, 16, 3)) * 0.3,
    )


def camera(width: int, height: int) -> Camera:
    """A camera at the origin whose principal point is off the center."""
    focal = 0.9 * width
    center = (0.47 * width, 0.54 * height)
    return Camera(Intrinsics(width, height, focal, focal, *center), np.eye(4))


def gsplat_projection(
    p: dict[str, torch.Tensor], view: Camera
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return centers [px] (n, 2), conics (n, 3), colors (n, 3) and depths (n,), all by gsplat."""
    k = view.intrinsics
    dtype = p["means"].dtype
    matrix = torch.tensor([[k.fx, 0, k.cx], [0, k.fy, k.cy], [0, 0, 1]], dtype=dtype)
    wxyz = p["quats"][:, [3, 0, 1, 2]]
    covariances, _ = gsplat._quat_scale_to_covar_preci(
        wxyz, torch.exp(p["log_scales"]), compute_preci=False
    )
    _, centers, depths, conics, _ = gsplat._fully_fused_projection(
        p["means"],
        covariances,
        torch.eye(4, dtype=dtype)[None],
        matrix[None],
        k.width,
        k.height,
        eps2d=DEFAULT_OPTIONS.dilation,
        near_plane=NEAR,
    )
    colors = torch.clamp_min(gsplat._spherical_harmonics(3, p["means"], p["sh"]) + 0.5, 0.0)
    return centers[0], conics[0], colors, depths[0]


def blend(
    parts: tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor],
    opacity_logits: torch.Tensor,
    view: Camera,
) -> torch.Tensor:
    """Return the image (height, width, 3) over white: every pixel against every splat, front to back."""
    o = DEFAULT_OPTIONS
    order = torch.argsort(parts[3])
    centers, conics, colors = (part[order] for part in parts[:3])
    k = view.intrinsics
    y, x = torch.meshgrid(torch.arange(k.height), torch.arange(k.width), indexing="ij")
    pixels = torch.stack([x, y], dim=-1).reshape(-1, 1, 2) + 0.5
    d = pixels - centers
    power = conics[:, 0] * d[..., 0] ** 2 + conics[:, 2] * d[..., 1] ** 2
    power = power / 2 + conics[:, 1] * d[..., 0] * d[..., 1]
    alpha = torch.sigmoid(opacity_logits[order]) * torch.exp(-power)
    alpha = torch.where(alpha >= o.min_alpha, torch.clamp_max(alpha, o.max_alpha), 0.0)
    after = torch.cumprod(1 - alpha, dim=1)
    before = torch.cat([torch.ones_like(after[:, :1]), after[:, :-1]], dim=1)
    drawn = after >= o.min_transmittance
    image = (torch.where(drawn, alpha * before, 0.0))[..., None] * colors
    left = torch.where(drawn, 1 - alpha, 1.0).prod(dim=1)
    return (image.sum(dim=1) + left[:, None]).reshape(k.height, k.width, 3)


def compare_gradients(splats: int, seeds: int) -> list[Result]:
    """Return the largest error of image and gradients over some scenes, relative to the largest value."""
    view = camera(64, 48)
    worst: dict[str, float] = dict.fromkeys(("image", *FIELDS), 0.0)
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        gaussians = random_gaussians(splats, rng)
        weights = rng.normal(size=(48, 64, 3))
        p = {
            name: torch.tensor(
                np.asarray(getattr(gaussians, name), dtype=np.float64), requires_grad=True
            )
            for name in FIELDS
        }
        image = blend(gsplat_projection(p, view), p["opacity_logits"], view)
        (image * torch.tensor(weights)).sum().backward()
        renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians), 64, 48)
        renderer.forward(view, near=NEAR)
        renderer.adj_image.assign(weights.astype(np.float32))
        renderer.backward()
        pairs: dict[str, tuple[np.ndarray, np.ndarray]] = {
            "image": (renderer.image.to_numpy(), image.detach().numpy())
        }
        for name, ours in zip(FIELDS, renderer.gradients.arrays, strict=True):
            theirs = p[name].grad
            assert theirs is not None
            pairs[name] = (ours.numpy().reshape(theirs.shape), theirs.numpy())
        for name, (ours, theirs) in pairs.items():
            error = float(np.abs(ours - theirs).max() / np.abs(theirs).max())
            worst[name] = max(worst[name], error)
    values = {f"{name} [of the largest]": value for name, value in worst.items()}
    return [Result({"splats": splats, "scenes": seeds}, values)]


def compare_times(splats: int) -> list[Result]:
    """Return times [ms] of projection and colors, forward and backward, float32, all cores."""
    view = camera(1280, 720)
    gaussians = random_gaussians(splats, np.random.default_rng(0))
    p = {
        name: torch.tensor(
            np.asarray(getattr(gaussians, name), dtype=np.float32), requires_grad=True
        )
        for name in FIELDS
    }
    renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians), 1280, 720)
    renderer.forward(view, near=NEAR)
    renderer.backward()
    stages = renderer.stages()
    total: list[torch.Tensor] = []

    def forward() -> None:
        total[:] = [sum(part.sum() for part in gsplat_projection(p, view)[:3])]  # type: ignore[list-item]

    def backward() -> None:
        total[0].backward()

    results = []
    for stage, ours, theirs, before in (
        ("forward", stages["project"], forward, None),
        ("backward", stages["gather and project back"], backward, forward),
    ):
        mine, other = best_ms(ours, ROUNDS), best_ms(theirs, ROUNDS, before)
        values = {"digs-warp [ms]": mine, "gsplat, PyTorch [ms]": other, "ratio": other / mine}
        results.append(Result({"splats": splats, "stage": stage}, values))
    return results


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--splats", type=int, default=100_000, help="of the timed scene")
    arguments = parser.parse_args()
    tables = [
        format_tables(compare_gradients(200, 10)),
        format_tables(compare_times(arguments.splats)),
    ]
    sys.stdout.write("\n\n".join(tables) + "\n")


if __name__ == "__main__":
    main()
