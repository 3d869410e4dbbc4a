"""The colours of planners with options on pages: near the planner's own, told apart, and readable on light and dark."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from antdrive.views.style import Colour, hexed, planner_style

DARK_LUMINANCE = 0.22  # of a colour on a dark page, at least: 4.3 times the contrast of the ground
LIGHT_LUMINANCE = 0.45  # of a colour on a light page, at most


class LabelStyle(NamedTuple):
    """How a planner is drawn.

    Attributes:
        light: its colour on a light page, as #rrggbb; no two labels of a page share one
        dark: its colour on a dark page
        dash: its line style
    """

    light: str
    dark: str
    dash: str


def label_styles(labels: Sequence[str], names: Sequence[str]) -> list[LabelStyle]:
    """The style of each label."""
    counts, seen = Counter(names), Counter[str]()
    styles: list[LabelStyle] = []
    for name in names:
        colour, dash = planner_style(name)
        place, count = seen[name], counts[name]
        seen[name] += 1
        if count > 1:  # from dark to light
            colour = _shifted(colour, -0.45 + 0.9 * place / (count - 1))
            dash = ("solid", "dashed", "dotted", "dashdot")[place % 4]
        light = _until(colour, LIGHT_LUMINANCE, darker=True)
        taken = {style.light for style in styles}
        while hexed(light) in taken:
            light = (light[0], light[1], (light[2] + 1) % 256)
        styles.append(LabelStyle(hexed(light), hexed(_until(colour, DARK_LUMINANCE, darker=False)), dash))
    return styles


def _shifted(colour: Colour, by: float) -> Colour:
    """A colour mixed with black (-1) or white (1)."""
    target = 255 if by > 0 else 0
    red, green, blue = (round(c + abs(by) * (target - c)) for c in colour)
    return red, green, blue


def _until(colour: Colour, luminance: float, *, darker: bool) -> Colour:
    """A colour, darker or lighter by as much as needed to reach a luminance."""
    for step in range(21):
        found = _shifted(colour, (-0.05 if darker else 0.05) * step)
        if (_luminance(found) <= luminance) if darker else (_luminance(found) >= luminance):
            break
    return found


def _luminance(colour: Colour) -> float:
    """Relative luminance (WCAG 2), 0 to 1."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (v / 255 for v in colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
