"""Object masks of a recording: read, or segmented by a network or from depth."""
