"""A handheld stereo depth camera, simulated: renders meshes along handheld trajectories."""
