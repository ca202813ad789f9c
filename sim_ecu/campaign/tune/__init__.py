"""`sim-ecu tune`: candidates by recorded conditions, the best of them by whole runs, one against the shipped design."""
