"""Settings for a capture and a time: what the trade-off study measured, scaled by the laws of its work."""
