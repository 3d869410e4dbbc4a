"""The pytest plugin's former name."""

pytest_plugins = ["antdrive.testing.plugin"]
