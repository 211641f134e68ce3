"""Endless made-up objects whose whole shape is known, drawn over photographs."""
