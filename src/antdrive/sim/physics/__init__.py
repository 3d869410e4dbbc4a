"""PyBullet behind an engine interface of poses, twists and contacts."""
