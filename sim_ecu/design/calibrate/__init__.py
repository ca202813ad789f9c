"""A vehicle's constants from its own logs: `sim-ecu calibrate`."""
