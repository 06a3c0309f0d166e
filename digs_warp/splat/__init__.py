"""The splat engine: projection, tile binning, rasterization and their gradients."""
