"""Import of robots from URDF and xacro files."""
