"""Initialization: from depth maps to coloured points to Gaussians (paper section 3.3)."""
