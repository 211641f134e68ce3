"""The composition LoRA of the paper (3.3): triplets made of pairs of pictures, and its training."""


class TrainingError(ValueError):
    """Triplets cannot be made, or the training cannot go on; one sentence."""
