from .dead_reckoning import DeadReckoning as DeadReckoning
from .scanner import Scanner as Scanner
