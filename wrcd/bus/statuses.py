"""What senders say of themselves: a signal that tells whether what stands beside it, or in another message, is to be
believed."""

from wrcd.bus.dbc import DEFAULT_TIMEOUT_MS, Message, find_signal, timeout_ms
from wrcd.bus.positions import Branch, Field, Numbers, frame_length
from wrcd.bus.signals import StatusRule

STATUS = "Status"


class SenderStatus:
    """A rule, and where its signal lies."""

    def __init__(self, message: Message, rule: StatusRule) -> None:
        signal, length = find_signal(message, rule.signal), frame_length(message)
        self.rule = rule
        self.field = Field(signal, length)
        self.branch = Branch(message, signal, length)
        _, self.shift, self._mask, _ = self.field.position
        self.ok, self.degraded = self._bits(rule.ok), self._bits(rule.degraded)

    def _bits(self, raws: frozenset[int]) -> frozenset[int]:
        """Raw values as they lie in a frame: those of a signed signal without their sign."""
        return raws if self.field.is_float else frozenset(raw & self._mask for raw in raws)

    @property
    def bits(self) -> int:
        """The mask of its bits in the frame as a whole number."""
        return self._mask << self.shift

    def word(self, numbers: Numbers) -> int | float:
        """What a frame says."""
        raw = self.field.raw(numbers)
        return raw if isinstance(raw, float) else raw & self._mask

    def judge(self, numbers: Numbers, stamp_us: int) -> bool | None:
        """Whether the sender of a frame calls itself degraded, None if it is not to be believed."""
        return self.verdict(self.word(numbers))

    def verdict(self, word: int | float | None) -> bool | None:
        """The same of what was stated."""
        return False if word in self.ok else True if word in self.degraded else None


class KeptStatus(SenderStatus):
    """One that comes in other frames than what it is about: the newest counts until it is too old."""

    _word: int | float | None
    _stamp_us: int

    def __init__(self, message: Message, rule: StatusRule) -> None:
        super().__init__(message, rule)
        stated_ms = timeout_ms(message, find_signal(message, rule.signal))
        self._timeout_us = rule.timeout_us or 1000 * (stated_ms or DEFAULT_TIMEOUT_MS)
        self.forget()

    def forget(self) -> None:
        """Nothing is known."""
        self._word = None
        self._stamp_us = 0

    def take(self, numbers: Numbers, stamp_us: int) -> None:
        """A frame of its message has come."""
        if self.branch.carried(numbers):
            self._word, self._stamp_us = self.word(numbers), stamp_us

    def judge(self, numbers: Numbers, stamp_us: int) -> bool | None:
        """Of the newest one, at a frame's time."""
        return self.verdict(self._word) if stamp_us - self._stamp_us <= self._timeout_us else None
