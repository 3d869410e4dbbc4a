"""Audits of what drives, logs and suites claim: `python -m tests.audit.NAME`."""
