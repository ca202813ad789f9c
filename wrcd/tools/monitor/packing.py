"""What goes from the reader's process to the screen's: messages of a length, a kind and a body. Imports no numpy."""

import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from wrcd.bus.frame import Frame

REMOTE, ERROR, FD = 1, 2, 4  # bits of a packed frame's flags
HEAD = struct.Struct("<IBBq")  # length of the body, kind, data bytes of its frames, until when all has been read (µs)
FRAMES, HEALTH, OPENED, FAILED = 1, 2, 3, 4  # kinds
CLASSICAL = (8, 64)  # data bytes that packed frames have
_STRUCTS = {width: struct.Struct(f"<qIBBB{width}s") for width in CLASSICAL}


def pack(frames: Sequence[Frame]) -> tuple[int, bytes]:
    """The data bytes that each frame has, and all frames."""
    width = CLASSICAL[any(f.fd and len(f.data) > CLASSICAL[0] for f in frames)]
    put = _STRUCTS[width].pack
    return width, b"".join(
        [put(f.stamp_us, f.key, f.remote | f.error << 1 | f.fd << 2, f.extra, len(f.data), f.data) for f in frames]
    )


def frames_message(frames: Sequence[Frame], until_us: int) -> bytes:
    """Frames, perhaps none, and until when everything that came has been read."""
    width, body = pack(frames)
    return HEAD.pack(len(body), FRAMES, width, until_us) + body


def told(kind: int, record: Mapping[str, Any]) -> bytes:
    """Anything else."""
    body = json.dumps(record).encode()
    return HEAD.pack(len(body), kind, 0, 0) + body


class Unpacker:
    """Cuts a stream into its messages."""

    def __init__(self) -> None:
        self._rest = b""

    def take(self, data: bytes) -> Iterator[tuple[int, int, int, bytes]]:
        """Kind, width, until_us and body of each message that is whole."""
        text, at = self._rest + data, 0
        while len(text) - at >= HEAD.size:
            length, kind, width, until_us = HEAD.unpack_from(text, at)
            end = at + HEAD.size + length
            if end > len(text):
                break
            yield kind, width, until_us, text[at + HEAD.size : end]
            at = end
        self._rest = text[at:]
