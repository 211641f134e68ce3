"""TRELLIS (Xiang et al. 2025, arXiv 2412.01506) in plain PyTorch: a picture becomes 3D Gaussians.

The paper's own lifter (3.1). No sparse-convolution or attention package is needed, so it runs
where PyTorch does. Names of parameters are those of the published weights, which are MIT:
https://github.com/microsoft/TRELLIS. The two lifters are imported without torch.
"""
