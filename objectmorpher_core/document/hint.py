"""From where the background is to be filled in, as the user says it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Hint:
    """The background around `to` is to be filled in with what is around `source`."""

    source: tuple[float, float]  # x, y px of the photo
    to: tuple[float, float]
    radius: float  # px, of both places

    def __post_init__(self) -> None:
        if not self.radius > 0:
            raise ValueError(f"a hint's radius is {self.radius:g} px")

    def moved(self, dx: float, dy: float, scale: tuple[float, float] = (1.0, 1.0)) -> Hint:
        """The same in px of a picture whose corner is at (-dx, -dy), `scale` across and down."""
        (a, b), (c, d) = self.source, self.to
        source = (a + dx) * scale[0], (b + dy) * scale[1]
        return Hint(source, ((c + dx) * scale[0], (d + dy) * scale[1]), self.radius * min(scale))
