"""Simulation of a run: scenario, physics, sensing, driving, log and certificate."""

import lazy_loader

# What this package offers is listed, with its types, in __init__.pyi; each name is imported when first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
