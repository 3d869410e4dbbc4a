"""Films and stills of runs, rendered from their logs."""
