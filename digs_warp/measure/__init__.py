"""How good a result is: images against images, surfaces against surfaces."""
