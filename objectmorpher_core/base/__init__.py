"""The foundation of every other folder: arrays, the camera, rotations, files, limits, threads."""
