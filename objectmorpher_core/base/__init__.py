"""What every other folder builds on: arrays, the camera, rotations, files, limits, threads."""
