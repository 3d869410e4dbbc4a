"""Other formats: Gazebo SDF, ROS map_server, MovingAI, BARN and DynaBARN."""
