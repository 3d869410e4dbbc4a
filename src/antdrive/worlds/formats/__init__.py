"""Formats of other programs, one module each: Gazebo SDF, BARN, DynaBARN, ROS map_server and MovingAI."""
