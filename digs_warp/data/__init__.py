"""Data at rest: what stages hand to each other, and the files it is read from and written to."""
