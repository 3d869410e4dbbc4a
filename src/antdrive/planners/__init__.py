"""Planners: queries, plans, replanning, smoothing, and the registry."""

import lazy_loader

# __init__.pyi lists what this package offers, with types; each name is imported when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
