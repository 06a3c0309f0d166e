"""From what a mesh file holds to the arrays of a `sim.scene.Scene`; `sim.load` is the door."""
