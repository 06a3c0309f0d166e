"""Render inside PyTorch: find the pose from which a picture was taken, by autograd.

python examples/08_torch.py [WIDTH FRAMES]    needs PyTorch: pip install 'digs-warp[torch]'
"""
# torch is an extra that type checking need not have:
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import sys

import torch

import digs_warp as dw
import digs_warp.torch

width, frames = map(int, sys.argv[1:3] or (160, 12))

capture = dw.simulate(frames=frames, width=width)
gaussians = dw.reconstruct(capture, iterations=10 * frames).gaussians
camera = capture.frames[0].camera
names = "means", "log_scales", "quats", "opacity_logits", "sh"
scene = [torch.from_numpy(getattr(gaussians, name)) for name in names]

# The picture was taken from elsewhere: a rotation vector [rad] and a translation [m] in the camera's frame.
truth = torch.tensor([0.02, -0.03, 0.01, 0.01, 0.0, -0.005])
target = digs_warp.torch.render(*scene, camera=camera, pose=truth).image

pose = torch.zeros(6, requires_grad=True)
optimizer = torch.optim.LBFGS([pose], max_iter=10, line_search_fn="strong_wolfe")


def loss_of_pose() -> torch.Tensor:
    """Return how much the picture from `pose` differs, with its gradient in `pose.grad`."""
    optimizer.zero_grad()
    view = digs_warp.torch.render(*scene, camera=camera, pose=pose)
    loss = ((view.image - target) ** 2).sum()
    loss.backward()
    return loss


for step in range(frames // 2):
    loss = optimizer.step(loss_of_pose)
    off = (pose - truth).abs().max().item()
    print(f"step {10 * step}: squared error {loss.item():.4f}, then the pose is off by {off:.5f}")
