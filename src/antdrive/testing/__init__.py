"""For tests of drives: the pytest plugin with its fixture `drive`, assertions, and hypothesis strategies."""

import lazy_loader

# Public names and their types are listed in __init__.pyi; each is imported on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
