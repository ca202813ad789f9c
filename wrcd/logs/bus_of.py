"""Which bus a tool opens: -i and -c, then the configuration's file, then python-can's own settings.

python-can's settings are the user's: CAN_INTERFACE, CAN_CHANNEL, CAN_BITRATE, CAN_CONFIG, and the files ~/can.conf,
/etc/can.conf, ~/.can, ~/.canrc. The daemon takes nothing from them.
"""

import argparse
import configparser
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wrcd.bus.link import Link
from wrcd.bus.opening import open_link
from wrcd.config.settings import read_toml
from wrcd.core.configuration import Config
from wrcd.errors import InputError

SOURCES = "CAN_INTERFACE, CAN_CHANNEL, CAN_CONFIG, ~/.canrc"


def bus_of(args: argparse.Namespace, config: Config) -> tuple[str, str]:
    """Interface and channel of a tool's arguments (interface, channel, config), as pick_bus says."""
    return pick_bus(args.interface, args.channel, args.config, (config.interface, config.channel))


def pick_bus(
    interface: str | None, channel: str | None, config_file: Path | None, default: tuple[str, str]
) -> tuple[str, str]:
    """Interface and channel, each by itself: the one that is given, else the file's, the user's, the default.

    A bus that the user's settings chose is reported on standard error. Raises InputError if they cannot be read.
    """
    if config_file is not None and (interface is None or channel is None):
        stated = read_toml(config_file).section("bus")
        interface = interface or stated.maybe("interface", str)
        channel = channel or stated.maybe("channel", str)
    if interface is None or channel is None:
        user = user_settings()
        chosen = interface or user.get("interface", default[0]), channel or user.get("channel", default[1])
        if (interface is None and "interface" in user) or (channel is None and "channel" in user):
            print(f"bus {':'.join(chosen)}, as python-can's settings say ({SOURCES})", file=sys.stderr)
        interface, channel = chosen
    return interface, channel


def open_bus_of(
    args: argparse.Namespace, config: Config, keys: tuple[int, ...] | None, fd: bool = False
) -> tuple[Link, str]:
    """Open a tool's bus, with what else the user's settings say of it: a bit rate, a serial number.

    fd: CAN FD frames are wanted from any interface; SocketCAN gives them anyway.
    Returns the link and the channel's name. Raises BusError.
    """
    interface, channel = bus_of(args, config)
    return open_link(interface, channel, keys, fd=fd or interface == "socketcan", user_settings=True), channel


def user_settings() -> dict[str, str]:
    """What the environment and python-can's files say of interface and channel. Raises InputError."""
    from can.util import load_environment_config, load_file_config

    hint = f"correct it, or say -i and -c; python-can reads {SOURCES}"
    try:
        environment: Any = load_environment_config()
    except (ValueError, TypeError) as e:
        raise InputError(f"is not JSON: {e}", key="CAN_CONFIG", hint=hint) from None
    if not isinstance(environment, Mapping):
        raise InputError("is no JSON object", key="CAN_CONFIG", hint=hint)
    try:
        files = load_file_config()
    except (configparser.Error, OSError, UnicodeDecodeError) as e:
        raise InputError(f"python-can's settings cannot be read: {' '.join(str(e).split())}", hint=hint) from None
    found: dict[str, str] = {}
    for source in (environment, files):
        for key, names in (("interface", ("interface", "bustype")), ("channel", ("channel",))):
            value = next((source[name] for name in names if source.get(name) not in (None, "")), None)
            if value is not None:
                found.setdefault(key, str(value))
    return found
