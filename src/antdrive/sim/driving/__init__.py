"""Driving a route in physics: the loop, the driver, perception, replanning and the log."""
