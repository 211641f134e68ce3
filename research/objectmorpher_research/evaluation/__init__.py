"""How good a result is: the measures of `objectmorpher evaluate` (docs/evaluation.md)."""
