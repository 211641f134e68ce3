"""Benchmarks of solver, renderers and the whole edit, on objects that they make themselves."""
