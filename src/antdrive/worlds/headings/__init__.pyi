from .rotations import Outline as Outline
from .rotations import sweep_clearance as sweep_clearance
from .rotations import turn_clear as turn_clear
