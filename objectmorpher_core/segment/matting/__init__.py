"""Soft cut-outs from a hard mask: the outline, alpha, and the object's own colours."""
