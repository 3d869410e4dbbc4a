"""The commands of `antdrive worlds`, one file each."""
