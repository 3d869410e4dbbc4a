"""Gymnasium environments: point-goal navigation among the worlds of this package, and the registration of their ids."""

import lazy_loader

from antdrive.base.optional import optional

# __init__.pyi lists the exports with their types; each name is imported on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

_gymnasium = optional("gymnasium", "gym", "environments for learning need it")

#: The worlds of each id, see `antdrive.gym.courses`.
IDS = {
    "antdrive/Forest-v0": "forest",
    "antdrive/Barn-v0": "barn",
    "antdrive/Halls-v0": "office",
    "antdrive/World-v0": "world",
    "antdrive/DynaBarn-v0": "dynabarn",
    "antdrive/Barn50-v0": "barn50",
}

for _id, _course in IDS.items():
    if _id not in _gymnasium.registry:
        _gymnasium.register(
            _id,
            entry_point="antdrive.gym.env:NavigationEnv",
            vector_entry_point="antdrive.gym.vector:NavigationVectorEnv",
            kwargs={"course": _course},
        )
