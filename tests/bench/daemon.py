"""`wrcd run` as on SocketCAN, with one end of a socket pair in the place of the raw CAN socket.

Run as a module with the pair's end as file descriptor 3. At its end it prints, as JSON, which modules it has imported
and the most memory that it held.
"""

import json
import sys
from pathlib import Path

from tests.bench.on_pair import CHANNEL, use_pair

END = 3


def resident_kb(pid: int | str = "self") -> dict[str, int]:
    """VmHWM and VmRSS of a process."""
    lines = (line.split() for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return {key[0].rstrip(":"): int(key[1]) for key in lines if key[0] in ("VmHWM:", "VmRSS:")}


def main() -> int:
    from wrcd.cli import main as cli

    use_pair(END)
    status = cli.main(["run", "-i", "socketcan", "-c", CHANNEL])
    print(json.dumps({"modules": sorted(sys.modules), **resident_kb()}))
    return status


if __name__ == "__main__":
    sys.exit(main())
