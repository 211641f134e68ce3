"""Rendering posed Gaussians: one specification (`reference`), one fast twin (`tiles`)."""
