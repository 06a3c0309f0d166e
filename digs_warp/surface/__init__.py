"""Surfaces of Gaussians: rendered depth fused into a colored triangle mesh."""
