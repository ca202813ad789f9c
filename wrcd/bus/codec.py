"""Any DBC to quantities and back. A frame is accepted whole or not at all, and every rejection has its reason."""

from collections.abc import Mapping, Sequence

from wrcd.bus.dbc import Database, data_id, find_message
from wrcd.bus.frame import EXTENDED, Frame
from wrcd.bus.positions import message_key, position
from wrcd.bus.readers import MessageReader, Sample, SignalReader
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.statuses import KeptStatus, SenderStatus
from wrcd.bus.writers import SignalWriter, Value, Writer

__all__ = [
    "MessageReader", "Receiver", "Sample", "SignalReader", "SignalWriter", "Value", "Writer", "message_key", "position",
]  # fmt: skip


class Receiver:
    """All mapped messages by their identity, those that carry nothing but a status of others among them.

    data_ids: of E2E, by message (None: not protected); of a message that is not among them, the DBC's.
    """

    readers: dict[int, MessageReader]
    _kept: tuple[KeptStatus, ...]

    def __init__(
        self, database: Database, sources: Sequence[Source], data_ids: Mapping[str, int | None] | None = None
    ) -> None:
        by_message: dict[str, list[tuple[int, Source]]] = {}
        for number, s in enumerate(sources):
            by_message.setdefault(s.message, []).append((number, s))
        kept = {
            rule: KeptStatus(find_message(database, rule.message), rule)
            for s in sources
            for rule in s.statuses
            if comes_in_other_frames(database, rule, s.message)
        }
        self._kept = tuple(kept.values())
        for status in self._kept:
            by_message.setdefault(status.rule.message, [])
        self.readers = {}
        messages = {name: find_message(database, name) for name in by_message}
        given = {} if data_ids is None else data_ids
        known = {name: given[name] if name in given else data_id(m) for name, m in messages.items()}
        every = [i for i in known.values() if i is not None]
        for name, group in by_message.items():
            self.readers[message_key(messages[name])] = MessageReader(messages[name], group, known[name], every, kept)

    @property
    def keys(self) -> tuple[int, ...]:
        """The identities of all mapped messages (Frame.key)."""
        return tuple(sorted(self.readers))

    @property
    def ends(self) -> list[tuple[float, float]]:
        """Of every source, from which values on (SI, lower and upper) it stands at an end of its range."""
        found = {signal.number: signal.ends for reader in self.readers.values() for signal in reader.signals}
        return [found[number] for number in range(len(found))]

    @property
    def fd(self) -> bool:
        """Whether any of them is CAN FD."""
        return any(reader.fd for reader in self.readers.values())

    def reset(self) -> None:
        """After a step of time or a long silence: take every counter as it comes, and believe no status of before."""
        for reader in self.readers.values():
            reader.reset()
        for status in self._kept:
            status.forget()

    def reader(self, frame: Frame) -> MessageReader | None:
        """The reader of a frame's message, None if it is not mapped. An error frame's class looks like an id, and never
        is."""
        return None if frame.error else self.readers.get(frame.can_id | EXTENDED if frame.extended else frame.can_id)

    def read(self, frame: Frame) -> list[Sample] | Reason | None:
        """Samples, the reason of a rejection, or None for a frame that is not mapped."""
        reader = self.reader(frame)
        return None if reader is None else reader.read(frame)


def comes_in_other_frames(database: Database, rule: StatusRule, message: str) -> bool:
    """Whether a status may come in other frames of a message, or of another one, than what it is about."""
    return rule.message != message or bool(SenderStatus(find_message(database, rule.message), rule).branch.conditions)
