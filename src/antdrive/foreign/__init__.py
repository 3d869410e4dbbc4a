"""Foreign logs: poses that other programs recorded, and what they prove."""

import lazy_loader

# __init__.pyi lists the public names and their types. Each name is imported when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
