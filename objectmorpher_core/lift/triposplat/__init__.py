"""TripoSplat (Yan et al. 2026, arXiv 2605.16355) in plain PyTorch: a picture becomes Gaussians.

As many as are asked for: they are drawn from a density that an octree says. Names of parameters
are those of the published weights, which are MIT but for those of the encoder that they were
trained with, DINOv3's: https://github.com/VAST-AI-Research/TripoSplat. The lifter is beside
TRELLIS's.
"""
