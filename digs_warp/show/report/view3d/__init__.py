"""The 3D view in the report: Gaussians in a few bytes each, and the WebGL that draws them."""
