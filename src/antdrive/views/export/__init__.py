"""Exports of drives: ROS 2 messages in MCAP files and rosbag2 folders, and CSV tables."""
