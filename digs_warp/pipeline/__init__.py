"""The whole reconstruction: from a capture to Gaussians."""
