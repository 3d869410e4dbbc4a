"""The commands, one file each; heavy modules are imported when a command runs.

These files do without `from __future__ import annotations`: typer needs the annotations' values, and would evaluate
each one from its text whenever the command line starts.
"""
