from .checking import CheckResult as CheckResult
from .checking import check_case as check_case
from .checking import check_cases as check_cases
from .fixture import DriveFailure as DriveFailure
from .fixture import DriveFixture as DriveFixture
from .fixture import assert_collision_free as assert_collision_free
from .fixture import assert_reached_goal as assert_reached_goal
