"""The loop closed: rig, controllers on the bus, lockstep, figures."""
