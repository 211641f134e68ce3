import numpy as np
import pytest

from objectmorpher_core.models.onnx_session import Looks


def test_what_was_seen_is_looked_at_once() -> None:
    looks, made = Looks[int](kept=2), []

    def look(*seen: np.ndarray, about: str = "") -> int:
        return looks.get(lambda: made.append(0) or len(made), *seen, about=about)

    one, wide = np.arange(6, dtype=np.uint8), np.arange(6, dtype=np.uint8).reshape(2, 3)
    assert [look(one), look(one.copy()), look(wide), look(one)] == [1, 1, 2, 1]
    assert look(wide, about="another network") == 3
    assert [look(wide), look(one)] == [2, 4], "the oldest was forgotten"


def test_a_look_that_fails_is_made_again() -> None:
    looks: Looks[int] = Looks()
    with pytest.raises(ZeroDivisionError):
        looks.get(lambda: 1 // 0, np.zeros(3))
    assert looks.get(lambda: 5, np.zeros(3)) == 5
