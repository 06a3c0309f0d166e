"""Poses of a film from its color and depth: odometry, loop edges and a pose graph."""
