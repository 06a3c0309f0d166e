"""Data sets at random: every scene is a draw from distributions; start at `digs_warp.sim.randomize.draws`."""
