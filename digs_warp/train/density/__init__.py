"""Density control: strategies that add, move and remove Gaussians while they are trained."""
