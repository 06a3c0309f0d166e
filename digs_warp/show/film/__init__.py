"""Films of Gaussians: camera paths, rendering one frame after the other, video files."""
