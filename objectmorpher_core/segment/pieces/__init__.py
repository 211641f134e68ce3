"""Selecting by pieces of the photo that keep to its edges."""
