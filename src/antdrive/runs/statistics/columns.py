"""The columns of a campaign's table that say what a run is. Pairing, notes and pages follow these lists."""

from __future__ import annotations

#: Where a run took place.
PLACE = ("world", "world_hash", "task")
#: The rest of what a run is, besides planner and seed. A table may lack some of them.
SETTINGS = (
    *("robot", "robot_hash", "smoothing", "noise", "margin_asked", "margin", "cell", "map", "localisation", "odometry"),
    *("controller", "sees", "avoid", "replan", "unseen", "time_limit", "physics_hz", "control_hz"),
)
#: What a robot knows of the world and of its pose.
SENSING = ("map", "localisation", "odometry")
#: The margin as the campaign asks for it, such as "auto", and the one that was driven with: runs are paired by the first.
ASKED, DRIVEN = "margin_asked", "margin"
#: A world's own cell size is no setting of the campaign, so that seeds are not judged apart for each size.
OF_WORLDS = ("cell",)
#: Hashes tell what equal names hide; pages show the names.
HASHES = ("world_hash", "robot_hash")
#: Columns that differ between repetitions of one drive: their median over repetitions is taken.
WALL_TIMES = ("plan_s", "drive_wall_s")
