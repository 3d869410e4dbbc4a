"""Counterparts of the parameters of Nav2's Regulated Pure Pursuit controller."""

from collections.abc import Mapping
from types import MappingProxyType

#: For each of Nav2's parameters what has its role: options of the controller, and limits of the robot file.
NAV2: Mapping[str, str] = MappingProxyType(
    {
        "desired_linear_vel": "`max_speed` of the robot",
        "lookahead_dist": "`preferred_lookahead_min` and `lookahead_max`, set equal",
        "use_velocity_scaled_lookahead_dist": "always true",
        "min_lookahead_dist": "`preferred_lookahead_min`; `lookahead_min` where that is not clear",
        "max_lookahead_dist": "`lookahead_max`",
        "lookahead_time": "`lookahead_time` on smooth routes, `corner_lookahead_time` on others; both also limit the speed",
        "use_regulated_linear_velocity_scaling": "always true",
        "regulated_linear_scaling_min_radius": "`max_lateral_acceleration` and `max_yaw_rate` of the robot",
        "regulated_linear_scaling_min_speed": "`creep_speed`",
        "use_cost_regulated_linear_velocity_scaling": "always true",
        "cost_scaling_dist": "`clearance_time`: the limit grows by clearance / `clearance_time`",
        "cost_scaling_gain": "`min_speed_near_obstacles`",
        "use_fixed_curvature_lookahead": "always true",
        "curvature_lookahead_dist": "`blend`, `corner_blend`",
        "use_rotate_to_heading": "always true",
        "rotate_to_heading_min_angle": "`rotate_in_place_above`; `rotate_in_place_above_at_rest` before the robot moves",
        "rotate_to_heading_angular_vel": "`max_yaw_rate` of the robot",
        "max_angular_accel": "`max_yaw_acceleration` of the robot",
        "approach_velocity_scaling_dist": "`braking`: constant deceleration instead of a distance",
        "min_approach_linear_velocity": "`creep_speed`",
        "use_collision_detection": "always true",
        "max_allowed_time_to_collision_up_to_carrot": "the whole arc to the carrot, and the stopping arc (`stopping_margin`)",
        "allow_reversing": "none; avoidance of movers and mapless robots reverse",
    }
)
