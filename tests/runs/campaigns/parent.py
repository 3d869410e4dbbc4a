"""A campaign of runs that take no time to speak of, in a process that tests kill: python -m tests.runs.campaigns.parent DIR."""

import signal
import sys

from antdrive.runs.campaigns import make_campaign, store
from antdrive.runs.campaigns.sweeping import sweep
from tests.runs.campaigns.works import Deadly

CAMPAIGN = {"worlds": ["empty", "gate"], "planners": ["astar"], "seeds": 150}


def go(folder, seconds, jobs):
    """Run the campaign, or what is left of it."""
    store.FLUSH_EVERY = 0.05
    campaign = make_campaign(CAMPAIGN)
    sweep(campaign, folder, jobs=jobs, work=Deadly(seconds=seconds))


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a shell starts in the background
    go(sys.argv[1], 0.2, 2)  # half a minute, so that a test on a busy machine disturbs it in the middle
