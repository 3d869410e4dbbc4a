"""What people see of a run: figures, films, reports, and a window that replays it."""
