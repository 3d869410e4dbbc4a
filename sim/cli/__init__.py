"""The command line."""

from antdrive.sim.cli.commands import main as main
