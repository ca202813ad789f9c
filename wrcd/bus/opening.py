"""Which link a bus is opened by. What a train does not need is not imported there."""

from wrcd.bus.link import Link


def open_link(
    interface: str,
    channel: str,
    keys: tuple[int, ...] | None,
    hardware_stamps: bool = False,
    fd: bool = False,
    user_settings: bool = False,
) -> Link:
    """Open a bus for some messages (Frame.key), or for every frame (None).

    SocketCAN is opened by our own socket, everything else by python-can.
    fd: CAN FD frames are wanted, too.
    user_settings: a tool's: python-can adds what its environment and its files say. Never the daemon's.
    hardware_stamps: of SocketCAN's controller, where it makes any; python-can's interfaces stamp as they do.
    Raises BusError if it can't be opened.
    """
    if interface == "socketcan":
        from wrcd.bus.socketcan import SocketCanLink

        link = SocketCanLink(channel, keys, fd)
        if hardware_stamps:
            link.stamp_by_hardware()
        return link
    from wrcd.bus.pythoncan import PythonCanLink

    return PythonCanLink(interface, channel, keys, user_settings=user_settings, **({"fd": True} if fd else {}))
