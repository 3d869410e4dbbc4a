"""Formulas of docstrings, which are plain text such as `tau^alpha`, in letters, superscripts and signs."""

from __future__ import annotations

import re

NAMES = ("alpha", "beta", "eta", "theta", "kappa", "rho", "tau", "phi", "omega")
GREEK = dict(zip(NAMES, "αβηθκρτφω", strict=True))
SIGNS = {"<=": "≤", ">=": "≥", "~": "∝"}
#: A letter, or a word for one, with what stands below and above it.
POWER = re.compile(r"(?<![\w`.])(\d+|[A-Za-z]|tau|eta|rho|[a-z]{3,}(?=\^))(_[a-zA-Z0-9]+)?(\^-?\w+)?(?![\w`])")
CODE = re.compile(r"(``[^`]+``|`[^`]+`|^ *:[^:\n]+:)", re.MULTILINE)  # and the names of fields


REST = r"\ :{0}:`{1}`\ "
HTML = "<{0}>{1}</{0}>"  # as Markdown takes it


def typeset(text: str, raised: str = REST) -> str:
    """Return a text with its formulas typeset, outside code; `raised` is the form of what stands above and below."""
    return "".join(part if i % 2 else _typeset(part, raised) for i, part in enumerate(CODE.split(text)))


def _typeset(text: str, raised: str) -> str:
    def formula(match: re.Match[str]) -> str:
        low, high = ((match[i] or " ")[1:] for i in (2, 3))
        parts = [raised.format(role, GREEK.get(part, part)) for role, part in (("sub", low), ("sup", high)) if part]
        return GREEK.get(match[1], match[1]) + "".join(parts)

    text = POWER.sub(formula, text)
    text = re.sub(r"\bsqrt\((\w+)\)", r"√\1", text).replace("sqrt(", "√(")
    text = re.sub(r"(?<=\d) x (?=\d)", " × ", text)
    return re.sub(r"(?<= )(<=|>=|~)(?= )", lambda m: SIGNS[m[0]], text)
