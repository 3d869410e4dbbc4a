"""Drive planned grid paths in physics: plan, drive, certify, film."""

import lazy_loader

# The public names and their types are listed in __init__.pyi; each is imported when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
