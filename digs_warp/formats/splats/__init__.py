"""Gaussians in the files of other programs: PLY, SPZ and .splat."""
