"""Renderers: what the left and right eye of the rig see."""
