"""What is learned from simulated recordings, tried on real frames."""
