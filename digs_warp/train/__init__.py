"""Training: optimizer, loop, evaluation."""
