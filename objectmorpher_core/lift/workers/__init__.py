"""Lifters in environments of their own, run as separate programs."""
