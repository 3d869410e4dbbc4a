"""What the command's exit code means to the shell and to scripts."""

from __future__ import annotations

SUCCEEDED = 0  # the command did what was asked, and its verdict is yes
FAILED = 1  # the command ran, and its verdict is no: no path, a wrong plan, a contact, not certified
INVALID_INPUT = 2  # something that a person wrote is wrong, or an output cannot be written
INTERNAL_ERROR = 3  # a planner or antdrive itself did something that it must not do
INTERRUPTED = 130  # Ctrl-C
BROKEN_PIPE = 141  # nobody reads any more what is printed, as in `antdrive ... | head`
TERMINATED = 143  # SIGTERM
