"""The papers' experiments, measured again: `reproduce` is the way in."""
