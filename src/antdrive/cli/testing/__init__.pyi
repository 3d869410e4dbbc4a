from .evaluation import CheckResult as CheckResult
from .evaluation import check_case as check_case
from .evaluation import check_cases as check_cases
from .fixture import DriveFailure as DriveFailure
from .fixture import DriveFixture as DriveFixture
from .fixture import assert_collision_free as assert_collision_free
from .fixture import assert_reached_goal as assert_reached_goal
