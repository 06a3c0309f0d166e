"""Recording: frames, labels and data sets, from a scene and a camera to a capture folder."""
