"""Scenarios, and playing them onto a bus or into a log."""
