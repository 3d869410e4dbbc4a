from .env import NavigationEnv as NavigationEnv
from .rewards import WEIGHTS as WEIGHTS
from .rewards import Facts as Facts
from .vector import NavigationVectorEnv as NavigationVectorEnv

IDS: dict[str, str]
