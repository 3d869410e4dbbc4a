"""Physics: the only package that imports PyBullet."""
