"""The rig: nonlinear wheelsets on a CAN bus, and the tools that design and check what the daemon runs."""
