"""The benchmark with ground truth: made photos of edits whose true result is known."""
