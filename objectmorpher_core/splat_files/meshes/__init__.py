"""Mesh files, sampled into Gaussians on their surface."""
