"""Campaigns: a grid of worlds, planners, robots, settings and seeds, driven in many processes, with a table of results."""

import lazy_loader

# What this package offers is listed, with its types, in __init__.pyi; each name is imported when first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
