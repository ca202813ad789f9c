"""What it costs to drive: what the time left of many runs is told from."""

# Processor time of a second that is driven, about: with one axle, for each more, and with the daemon.
COST, COST_OF_AXLE, COST_OF_DAEMON, COST_OF_ITS_AXLE = 1.0, 0.5, 1.2, 0.8


def cost_of_driving(axles: int, daemon: bool) -> float:
    """Of a second, in any unit."""
    more = axles - 1
    return COST + COST_OF_AXLE * more + daemon * (COST_OF_DAEMON + COST_OF_ITS_AXLE * more)
