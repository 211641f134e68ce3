"""The errors of an evaluation."""


class EvaluationError(ValueError):
    """A measurement is impossible; one sentence for the user."""
