"""Vocabulary of space: rigid motions, pinhole cameras, spherical harmonics."""
