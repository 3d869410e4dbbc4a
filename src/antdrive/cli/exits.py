"""Exit codes of the command line."""

from __future__ import annotations

SUCCEEDED = 0  # success
FAILED = 1  # the command ran with a negative result: no path, invalid plan, contact, not certified
INVALID_INPUT = 2  # invalid user input, or an output that cannot be written
INTERNAL_ERROR = 3  # error of a planner or of antdrive itself
INTERRUPTED = 130  # Ctrl-C
HUNG_UP = 129  # SIGHUP: the terminal closed
BROKEN_PIPE = 141  # output pipe closed, as in `antdrive ... | head`
TERMINATED = 143  # SIGTERM
