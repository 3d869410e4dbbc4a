"""Drives for other programs: ROS 2 messages in MCAP files and rosbag2 folders, and tables."""
