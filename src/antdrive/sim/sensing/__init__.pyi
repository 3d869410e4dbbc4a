from .mapping import OccupancyMap as OccupancyMap
from .mapping import clear_way as clear_way
from .mapping import shape_of as shape_of
from .scanner import Scanner as Scanner
from .tracking import KnownGround as KnownGround
from .tracking import MappedGround as MappedGround
from .tracking import MoverTracker as MoverTracker
from .tracking import TrackedMovers as TrackedMovers
