"""Data sets at random: every scene is a draw from distributions; start at `draws.py`."""
