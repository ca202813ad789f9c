"""What is laid out on request only. Every start of the daemon imports this: it needs nothing."""

# What each is. A bit rate that is not the train's, or simulated sensors on the
# train's bus, would do harm.
GROUPS = {
    "can0": "bit rate (500 kbit/s) and recovery from bus-off of can0, for systemd-networkd",
    "vcan0": "a virtual bus vcan0, for systemd-networkd",
    "realtime": "SCHED_FIFO and locked memory for every wrcd@ unit",
    "rig": "sim-ecu@.service, which plays simulated sensors onto a bus (extra bench)",
}
