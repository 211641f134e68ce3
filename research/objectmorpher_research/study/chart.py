"""A study's means and intervals as an SVG picture: one panel a criterion, one row a method."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from ..evaluation.bootstrap import Estimate
from .design import CRITERIA, LEAST, MOST
from .figures import Figures

TITLES = {
    "guidance": "Guidance following",
    "realism": "Realism and style",
    "identity": "Identity",
}
COLOURS = {"guidance": "#0072b2", "realism": "#d55e00", "identity": "#009e73"}  # Okabe & Ito 2008
ROW, PANEL, GAP, TOP, FOOT = 34, 230, 30, 64, 58  # px
LETTER = 7.6  # px, of the names at 14 px
INK, SOFT, PAPER, LINE = "#1d2127", "#5c6570", "#ffffff", "#d9dde2"


def draw_chart(figures: Figures) -> str:
    """An SVG file. Nothing in it is loaded from elsewhere."""
    names = [method.method for method in figures.methods]
    left = 34 + LETTER * max((len(name) for name in names), default=0)
    width = left + len(CRITERIA) * (PANEL + GAP) + 10
    bottom = TOP + ROW * len(names)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{bottom + FOOT}"'
        f' viewBox="0 0 {width:.0f} {bottom + FOOT}" font-family="system-ui, sans-serif">',
        f'<rect width="100%" height="100%" fill="{PAPER}"/>',
    ]
    for row, name in enumerate(names):
        parts.append(_text(left - 18, TOP + ROW * (row + 0.5) + 5, name, anchor="end"))
    for k, criterion in enumerate(CRITERIA):
        x = left + k * (PANEL + GAP)
        means = [method.means[criterion] for method in figures.methods]
        parts += _panel(x, bottom, criterion, means)
        if (alpha := figures.alpha.get(criterion)) is not None and alpha.value == alpha.value:
            told = f"Krippendorff’s α {alpha.value:.2f}"
            parts.append(_text(x + PANEL / 2, bottom + 44, told, 12, SOFT, "middle"))
    told = f"{figures.counted} participants, 95 % intervals over participants"
    parts += [_text(left, 20, told, 12, SOFT), "</svg>\n"]
    return "\n".join(parts)


def _panel(x: float, bottom: float, criterion: str, means: Sequence[Estimate]) -> list[str]:
    def at(value: float) -> float:
        return x + 8 + (value - LEAST) / (MOST - LEAST) * (PANEL - 16)

    parts = [_text(x + PANEL / 2, TOP - 16, TITLES[criterion], 15, INK, "middle", "600")]
    for value in range(LEAST, MOST + 1):
        parts.append(
            f'<line x1="{at(value):.1f}" x2="{at(value):.1f}" y1="{TOP}" y2="{bottom}"'
            f' stroke="{LINE}"/>'
        )
        parts.append(_text(at(value), bottom + 20, str(value), 12, SOFT, "middle"))
    colour = COLOURS[criterion]
    for row, found in enumerate(means):
        y = TOP + ROW * (row + 0.5)
        if found.value != found.value:
            continue
        if found.low is not None and found.high is not None:
            parts.append(
                f'<line x1="{at(found.low):.1f}" x2="{at(found.high):.1f}" y1="{y}" y2="{y}"'
                f' stroke="{colour}" stroke-width="5" stroke-linecap="round" opacity="0.35"/>'
            )
        parts.append(f'<circle cx="{at(found.value):.1f}" cy="{y}" r="5.5" fill="{colour}"/>')
        is_right = found.value > (LEAST + MOST) / 2
        edge = (found.low if is_right else found.high) or found.value
        offset, anchor = (-10, "end") if is_right else (10, "start")
        parts.append(_text(at(edge) + offset, y + 4, f"{found.value:.2f}", 12, INK, anchor))
    return parts


def _text(
    x: float, y: float, text: str, size: int = 14, colour: str = INK, anchor: str = "start",
    weight: str = "400",
) -> str:  # fmt: skip
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{colour}"'
        f' text-anchor="{anchor}" font-weight="{weight}">{escape(text)}</text>'
    )
