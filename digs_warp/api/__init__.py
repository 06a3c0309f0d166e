"""The front door: the functions that ``import digs_warp`` offers, with plain keyword settings."""
