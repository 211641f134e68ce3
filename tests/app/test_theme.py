"""Colours that can be read: WCAG 2.2, level AA."""

from __future__ import annotations

import pytest

from objectmorpher.gui.widgets.theme import PALETTES, Palette, rgb

TEXT = 4.5  # contrast of text of the usual size
PARTS = 3.0  # of what is no text but means something, and of large text
ON = ("surround", "panel", "raised", "hovered")


def luminance(code: str) -> float:
    """Relative luminance of WCAG 2."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgb(code)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_contrast_is_as_wcag_has_it() -> None:
    assert contrast("#000000", "#FFFFFF") == pytest.approx(21.0)
    assert contrast("#777777", "#FFFFFF") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("name", PALETTES)
@pytest.mark.parametrize("under", ON)
def test_texts_can_be_read(name: str, under: str) -> None:
    palette: Palette = PALETTES[name]
    below = getattr(palette, under)
    assert contrast(palette.text, below) >= TEXT
    assert contrast(palette.secondary, below) >= TEXT


@pytest.mark.parametrize("name", PALETTES)
def test_messages_and_buttons_can_be_read(name: str) -> None:
    palette: Palette = PALETTES[name]
    for role in ("warning", "error", "accent"):
        assert contrast(getattr(palette, role), palette.panel) >= TEXT, role
    for role in ("accent", "accent_hovered"):
        assert contrast(palette.on_accent, getattr(palette, role)) >= TEXT, role
    assert contrast(palette.accent, palette.raised) >= PARTS
