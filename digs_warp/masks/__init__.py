"""Object masks of a recording: read, segmented by a network or from depth, or degraded on purpose."""
