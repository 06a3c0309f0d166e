"""What a run leaves behind: files, their names, the record of settings and times, progress."""
