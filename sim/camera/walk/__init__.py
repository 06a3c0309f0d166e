"""How a hand carries a camera around an object; start at `digs_warp.sim.camera.walk.walk`."""
