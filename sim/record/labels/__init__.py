"""Labels for training, on request: what else is true of the pixels of a frame."""
