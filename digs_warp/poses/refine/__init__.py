"""Poses that are nearly right, refined by the color and depth of all frames together."""
