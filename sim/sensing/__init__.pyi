from .dead_reckoning import DeadReckoning as DeadReckoning
from .mapping import OccupancyMap as OccupancyMap
from .scanner import Scanner as Scanner
