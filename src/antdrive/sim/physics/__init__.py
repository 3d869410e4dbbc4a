"""Physics: PyBullet behind an engine that speaks in poses, twists and contacts."""
