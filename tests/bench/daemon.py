"""`wrcd run` as on SocketCAN, with one end of a socket pair in the place of the raw CAN socket.

Run as a module with the pair's end as file descriptor 3. At its end it prints, as JSON, which modules it has imported
and the most memory that it held.
"""

import json
import socket
import sys
from pathlib import Path

END = 3
CHANNEL = "lo"  # rtnetlink tells of an interface that is up


def resident_kb() -> dict[str, int]:
    """VmHWM and VmRSS of this process."""
    lines = (line.split() for line in Path("/proc/self/status").read_text().splitlines())
    return {key[0].rstrip(":"): int(key[1]) for key in lines if key[0] in ("VmHWM:", "VmRSS:")}


def main() -> int:
    from wrcd.bus import socketcan
    from wrcd.tools import cli

    def opened(link: socketcan.SocketCanLink) -> socket.socket:
        end = socket.socket(fileno=END)
        end.setblocking(False)
        link._stamp(end)
        return end

    # the kernel may have no CAN: the daemon's own link, with one end of a pair in the place of the raw CAN socket
    socketcan.SocketCanLink._open = opened  # type: ignore[assignment,method-assign]
    socketcan.SocketCanLink._set = lambda *_: None  # type: ignore[method-assign]
    status = cli.main(["run", "-i", "socketcan", "-c", CHANNEL])
    print(json.dumps({"modules": sorted(sys.modules), **resident_kb()}))
    return status


if __name__ == "__main__":
    sys.exit(main())
