"""Splat files, a format a file."""
