"""Regression tests of drives: suites of scenarios and their baselines."""

import lazy_loader

# __init__.pyi lists the exports with their types; each name is imported on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
