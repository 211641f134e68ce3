"""Shadows: new ones that are cast, old ones that are taken away."""
