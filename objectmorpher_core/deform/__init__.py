"""As-rigid-as-possible editing of Gaussians through a few control points (paper 3.2)."""
