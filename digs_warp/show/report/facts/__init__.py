"""The facts that `digs-warp info` prints about each kind of file or folder."""
