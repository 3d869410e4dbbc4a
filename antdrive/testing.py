"""For tests of drives: assertions, hypothesis strategies, and what the pytest fixture `drive` gives.

The pytest plugin that comes with antdrive collects suites, `*.drive.yaml`, and has the fixture.
"""

import lazy_loader

# The names and their types are listed in testing.pyi; each is imported when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub("antdrive", __file__)
