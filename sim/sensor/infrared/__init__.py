"""Cameras with an infrared pair: a projector of dots for the pair, and a color camera at its own place."""
