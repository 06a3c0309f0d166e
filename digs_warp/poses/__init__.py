"""Camera poses from color and depth: alignment of all frames at once, from poses that are nearly right."""
