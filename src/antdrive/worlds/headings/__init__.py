"""Exact free headings of a convex outline among discs and walls, and exact sweeps of its moves and turns."""

import lazy_loader

# __init__.pyi lists the public names and their types. Each name is imported when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
