"""Rendering of pages: values as text, runs as JSON, and templates."""

from __future__ import annotations

import functools
import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

from antdrive.base.files import relative
from antdrive.base.tables import markdown_text
from antdrive.base.version import __version__
from antdrive.runs.statistics.intervals import Interval
from antdrive.sim.facts import FACTS, Fact

if TYPE_CHECKING:
    import jinja2
    import markupsafe

NONE = "–"
LONGEST = 200  # characters per text
#: Characters that act instead of showing: control codes but tabs and line breaks, and codes for the direction of text.
ACTING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u202a-\u202e\u2060-\u206f\ufeff\ud800-\udfff]")


class TextTable(NamedTuple):
    """Table of text."""

    title: str
    headings: tuple[str, ...]  # of the columns
    rows: list[tuple[str, ...]]  # cells
    note: str = ""  # of its caption: tests and directions


def percent(fraction: float) -> str:
    """Format a fraction in percent with one decimal; 100.0 is shown only if exact."""
    if math.isnan(fraction):
        return NONE
    shown = f"{100 * fraction + 0.0:.1f}"
    if shown == "100.0" and fraction < 1:
        return f"{math.floor(10_000 * fraction) / 100:.2f}"
    return "0.0" if shown == "-0.0" else shown


def percents(interval: Interval) -> str:
    """Format an interval of fractions in percent."""
    return NONE if math.isnan(interval.low) else f"{percent(interval.low)} to {percent(interval.high)}"


TITLES = {
    "plan_s": "planning time",
    "drive_wall_s": "wall time of the drive",
    "path_length_m": "planned length",
    "bound_m": "certified clearance",
    "physics_hz": "physics rate",
    "control_hz": "control rate",
}
UNITS = ("_rad_per_m", "_m2", "_m", "_s", "_hz")  # suffixes of names
#: Units in which pages show facts, and their factors, where these are not the facts' own.
SHOWN_IN = {
    "plan_s": ("ms", 1000.0),
    "gap_to_grid_optimum": ("%", 100.0),
    "gap_to_euclidean_optimum": ("%", 100.0),
}


class Quantity(NamedTuple):
    """How pages show the values of a column."""

    title: str
    unit: str  # empty without one
    factor: float  # from the column's own unit

    @classmethod
    def of(cls, name: str) -> Quantity:
        """Return the quantity of a column."""
        fact = _fact_of(name)
        unit = "" if fact is None or fact.unit == "1" else fact.unit
        plain = next((name.removesuffix(suffix) for suffix in UNITS if unit and name.endswith(suffix)), name)
        title = TITLES.get(name, plain.removeprefix("option.").replace("_", " "))
        return cls(title, *SHOWN_IN.get(name, (unit, 1.0)))

    @property
    def heading(self) -> str:
        """Title with unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def text(self, value: float) -> str:
        """Format a value without its unit."""
        return short(self.factor * value)


def measure_title(name: str) -> str:
    """Return a column's heading with its unit."""
    return Quantity.of(name).heading


def _fact_of(name: str) -> Fact | None:
    """Return the fact that a column or a setting holds; a setting's name has no unit."""
    return next((FACTS[known] for known in (name, f"{name}_m", f"{name}_s") if known in FACTS), None)


def short(value: float) -> str:
    """Format a number with three significant digits."""
    if not math.isfinite(value):
        return NONE if math.isnan(value) else "∞"
    if value == 0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(float(f"{value:.2e}")))))
    text = f"{value:.{min(digits, 6)}f}"
    return "0" if float(text) == 0 else text


def probability(p: float) -> str:
    """Format a p-value."""
    if math.isnan(p):
        return NONE
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def number(value: Any) -> float | None:
    """Return a finite number as a float; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        converted = float(value)
    except OverflowError:
        return None
    return converted if math.isfinite(converted) else None


def shown(value: Any, longest: int = LONGEST) -> str:
    """Format a value as one line of printable characters, cut to a length."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or value != value:
        return NONE
    if isinstance(value, float):
        return f"{value:.6g}"
    text = repr(value) if isinstance(value, list | dict) else str(value)
    text = "".join(c if c.isprintable() else " " for c in text[: 4 * longest])
    text = " ".join(text.split())
    return text if len(text) <= longest else f"{text[:longest]}…"


ROUNDING = 1e-12  # smaller numbers are 0
SIGNIFICANT = 6  # significant digits of numbers in a page


def script_json(value: Any) -> str:
    """Return JSON for a script element."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def json_column(name: str, values: Sequence[Any]) -> dict[str, Any] | None:
    """Return a column as numbers in the unit of its heading, or as texts; None if it is empty."""
    if all(value is None for value in values):
        return None
    if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
        factor = Quantity.of(name).factor
        return {"name": name, "numbers": [_number(value, factor) for value in values]}
    return {"name": name, **json_texts([None if value is None else str(value) for value in values])}


def json_texts(given: Sequence[str | None]) -> dict[str, Any]:
    """Return texts, or the distinct texts and each row's index among them."""
    values = [None if value is None else ACTING.sub(" ", value) for value in given]
    different = {value: k for k, value in enumerate(dict.fromkeys(value for value in values if value is not None))}
    if len(different) == len(values):
        return {"texts": list(values)}
    return {"texts": list(different), "places": [-1 if value is None else different[value] for value in values]}


def _number(value: Any, factor: float) -> float | int | None:
    if value is None or not math.isfinite(value):
        return None
    if isinstance(value, int) and factor == 1:
        return value
    rounded = 0.0 if abs(value) < ROUNDING else float(f"{factor * value:.{SIGNIFICANT}g}")
    return int(rounded) if rounded.is_integer() and abs(rounded) < 1e15 else rounded


#: Parts of a page that only campaigns have.
NO_PARTS: Mapping[str, Any] = MappingProxyType({"success": (), "pairs": (), "charts": (), "allowances": None})


def rendered(template: str, **content: Any) -> str:
    """Fill a template: `page.html.j2` or `page.md.j2`."""
    text = _environment().get_template(template).render(**{**NO_PARTS, **content}, version=__version__)
    return ACTING.sub(" ", text)


@functools.cache
def _environment() -> jinja2.Environment:
    """Return the environment that keeps compiled templates."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(["html.j2"]),
    )
    environment.filters |= {"md": lambda value: markdown_text(str(value)), "fence": fence_for, "prose": _prose}
    return environment


def _prose(text: str) -> markupsafe.Markup:
    """Return a text as HTML, with `code` between backticks."""
    from markupsafe import Markup

    parts = enumerate(re.split("`([^`]+)`", text))
    return Markup().join(Markup("<code>{}</code>").format(part) if k % 2 else part for k, part in parts)


def link_to(path: Path, base: Path) -> str:
    """Return a file's path relative to the page's folder, quoted for a URL."""
    return quote(relative(path.resolve(), base.resolve()))


def fence_for(code: str) -> str:
    """Return a code fence longer than any run of backticks in the code."""
    return "`" * max(3, 1 + max(map(len, re.findall("`+", code)), default=0))
