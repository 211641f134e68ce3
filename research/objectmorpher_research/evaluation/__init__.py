"""The measures of `objectmorpher evaluate` (docs/evaluation.md)."""
