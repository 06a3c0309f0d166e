"""Surfaces of Gaussians: rendered depth fused into a coloured triangle mesh."""
