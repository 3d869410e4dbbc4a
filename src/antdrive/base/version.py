"""The installed version of antdrive."""

import importlib.metadata

#: The installed version, such as "0.2.0".
__version__ = importlib.metadata.version("antdrive")
