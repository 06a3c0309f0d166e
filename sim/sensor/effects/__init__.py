"""The effects of the planned tier, one file each, and their physical order."""
