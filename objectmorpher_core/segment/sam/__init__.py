"""Selecting by Segment Anything models."""
