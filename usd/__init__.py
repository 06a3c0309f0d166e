"""Gaussian scenes in USD: write, read, validate (schema ``ParticleField3DGaussianSplat``)."""
