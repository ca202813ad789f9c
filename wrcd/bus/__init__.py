"""Frames: end-to-end protection, any DBC to quantities and back, links, logs. Knows nothing of estimation."""
