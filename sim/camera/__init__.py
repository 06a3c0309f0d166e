"""The handheld camera: its profiles, its rig, the walk and the shutter."""
