"""What the evaluation tells where it cannot go on."""


class EvaluationError(ValueError):
    """What cannot be measured; one sentence for the user."""
