"""Feed a recording to PyTorch: a data loader with two workers, and views of a whole batch in one call.

python examples/09_torch_data.py [WIDTH FRAMES]    needs PyTorch: pip install 'digs-warp[torch]'
"""
# torch is an extra that type checking need not have:
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import sys

import torch

import digs_warp as dw
import digs_warp.torch

width, frames = map(int, sys.argv[1:3] or (160, 12))

capture = dw.simulate(frames=frames, width=width)
data = digs_warp.torch.CaptureDataset(capture)
loader = torch.utils.data.DataLoader(data, batch_size=4, shuffle=True, num_workers=2)
for batch in loader:
    known = batch["depth"].isfinite()
    print(batch["name"], tuple(batch["image"].shape), f"depth known: {known.float().mean():.0%}")

gaussians = dw.reconstruct(capture, iterations=10 * frames).gaussians
names = "means", "log_scales", "quats", "opacity_logits", "sh"
scene = [torch.from_numpy(getattr(gaussians, name)) for name in names]
cameras = [frame.camera for frame in capture.frames[:3]]
views = digs_warp.torch.render(*scene, camera=cameras)
print("views:", tuple(views.image.shape))
