"""The command line."""

from antdrive.sim.cli.app import main as main
