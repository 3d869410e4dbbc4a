"""The commands below `antdrive robots`."""
