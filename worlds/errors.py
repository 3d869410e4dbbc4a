"""The one exception for wrong input."""

from __future__ import annotations


class InputError(ValueError):
    """Something a person wrote is wrong; the message is one line that says where and what would be right."""
