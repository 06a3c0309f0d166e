"""What is in front of the camera: meshes, materials, ground, surroundings, and how they are put together."""
