"""PixelHacker (Xu et al. 2025, arXiv 2504.20438) in plain PyTorch: a diffusion that fills holes.

The paper's own inpainter (3.3). Parameters are named as in the published weights (Apache-2.0):
https://github.com/hustvl/PixelHacker. This package itself is imported without torch.
"""
