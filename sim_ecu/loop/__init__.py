"""The loop closed: rig, controller on the bus, lockstep, figures."""
