from .dead_reckoning import DeadReckoning as DeadReckoning
from .mapping import OccupancyMap as OccupancyMap
from .scanner import Scanner as Scanner
from .sight import clear_distance as clear_distance
from .sight import clear_turn as clear_turn
from .tracking import MoverTracker as MoverTracker
from .tracking import TrackedMovers as TrackedMovers
from .tracking import TrackingPolicy as TrackingPolicy
