"""3D Gaussians in and out of files; a format a file."""
