"""Initialization: from depth maps to colored points to Gaussians (paper section 3.3)."""
