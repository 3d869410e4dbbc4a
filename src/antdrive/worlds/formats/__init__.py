"""Imports and exports: Gazebo SDF, BARN, DynaBARN, ROS map_server and MovingAI."""
