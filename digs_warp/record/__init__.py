"""The output of a run: files, their names, the record of settings and times, progress."""
