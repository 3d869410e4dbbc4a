"""The commands, one file each; heavy modules are imported when a command runs."""
