"""Logs of a fleet: which there are, what the daemon makes of each, and a page of them all."""
