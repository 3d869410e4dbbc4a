"""Why a new route was planned, as the log records it."""

STRAYED = "strayed"
LATE = "late"
WAITED = "waited"
OBSTRUCTED = "obstructed"
TRAFFIC = "traffic"
MISSED = "missed the goal"

# Without a map.
DISCOVERED = "discovered"
STALLED = "stalled"
HELD = "held by sight"
BACKED = "backed off"
MADE_ROOM = "made room"
LOST = "no way"
LOOKED = "looked round"
