from . import planners as planners
from . import robots as robots
from . import sim as sim
from . import worlds as worlds
