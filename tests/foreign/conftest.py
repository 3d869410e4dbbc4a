"""What tests of foreign logs share with those of the command line."""

from tests.cli.conftest import antdrive  # noqa: F401
