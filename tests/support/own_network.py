"""A network of its own, with a bus in it: vcan0 where the kernel has vcan, else python-can's udp_multicast."""

import subprocess
from functools import cache

import pytest

from tests.support.tools import missing

BUS, MULTICAST = "-i socketcan -c vcan0", "-i udp_multicast -c 239.74.163.2"
_NETWORK = ("unshare", "--map-root-user", "--net", "sh", "-ec")
_VCAN = "ip link add vcan0 type vcan && ip link set vcan0 up"
_LOOPBACK = "ip link set lo up && ip route add 224.0.0.0/4 dev lo"


@cache
def own_network() -> tuple[list[str], str]:
    """What begins a command that runs in a network of its own, and how its programs are told of the bus. Skips the test
    where such a network is not to be had."""
    if lacks := missing("unshare", "ip"):
        pytest.skip(lacks)
    for setup, bus in ((_VCAN, BUS), (_LOOPBACK, MULTICAST)):
        prefix = [*_NETWORK, f'{setup} && exec "$@"', "sh"]
        if subprocess.run([*prefix, "true"], capture_output=True, check=False).returncode == 0:
            return prefix, bus
    pytest.skip("needs a network of its own; sysctl kernel.unprivileged_userns_clone=1, or be root")
