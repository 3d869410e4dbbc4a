"""Films and stills of runs, rendered from logs."""
