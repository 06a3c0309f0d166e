"""The data that stages pass to each other, and the files it is read from and written to."""
