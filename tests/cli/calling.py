"""The types of the fixtures that call the command line."""

from collections.abc import Callable
from typing import TypeAlias

Call: TypeAlias = Callable[..., tuple[int, str, str]]  # words -> exit code, stdout, stderr
Refused: TypeAlias = Callable[..., str]  # words -> the one line on stderr
