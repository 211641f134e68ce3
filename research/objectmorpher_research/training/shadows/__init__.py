"""Endless made-up scenes in which a thing throws a shadow, or something else is dark beside it."""
