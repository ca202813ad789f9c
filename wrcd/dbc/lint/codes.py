"""What lint can find: a stable word for each, why it matters, how to mend it. The documentation is made from here."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Code:
    """A kind of fault."""

    found: str  # what is the case
    why: str
    mend: str


@dataclass(frozen=True, slots=True)
class Flaw:
    """One fault: where, of which kind, what it is about (a message, a signal), and the figures."""

    line: int
    code: str
    subject: str
    what: str


CODES: dict[str, Code] = {
    # the text
    "not-loadable": Code(
        "the file cannot be loaded",
        "Nothing of it can be used.",
        "Mend what the message names; what else is found is below.",
    ),
    "byte-order-mark": Code(
        "the file begins with a byte order mark",
        "Other tools call it a syntax error.",
        "Save the file without it.",
    ),
    "non-ascii-unit": Code(
        "a unit has characters beyond ASCII",
        "A DBC states no encoding: what one tool writes as m/s², another reads as m/sÂ².",
        "Write m/s2, deg/s, N.m, Ohm. In the configuration: `unit`, or `encoding` under [dbc].",
    ),
    "unknown-reference": Code(
        "a statement is about a message or a signal that is not there",
        "Loading drops it in silence: words, times or E2E that somebody meant are not in force.",
        "Correct the id or the name, or delete the statement.",
    ),
    # the layout of frames
    "duplicate-id": Code(
        "two messages have one id of one kind",
        "Only one of them is decoded, the other's frames are read as the wrong signals.",
        "Give each its own id; two layouts of one message are multiplexed signals.",
    ),
    "duplicate-message": Code(
        "two messages have one name",
        "A configuration names messages: the later hides the earlier.",
        "Rename one of them.",
    ),
    "duplicate-signal": Code(
        "two signals of a message have one name",
        "The later hides the earlier.",
        "Rename one of them.",
    ),
    "impossible-id": Code(
        "an id has more bits than a frame's: 11 of a standard one, 29 of an extended one",
        "No frame has it. An extended id without the DBC's mark of one (2147483648) looks so.",
        "Correct the id, or add the mark.",
    ),
    "undeclared-sender": Code(
        "a message's sender is not among the nodes",
        "It is a typing error, or the node was deleted and its messages are no longer sent.",
        "Name the node under BU_, or write Vector__XXX.",
    ),
    "undeclared-receiver": Code(
        "a signal's receiver is not among the nodes",
        "It is a typing error, or the node was deleted.",
        "Name the node under BU_, or write Vector__XXX.",
    ),
    "signal-outside-message": Code(
        "a signal has bits that the message has not",
        "No frame carries it. Strict loading refuses the file.",
        "Correct start, length or byte order, or the message's length.",
    ),
    "signals-overlap": Code(
        "two signals share bits",
        "At least one of them is wrong in every frame. Strict loading refuses the file.",
        "Correct start, length or byte order; signals that take turns are multiplexed.",
    ),
    "no-bits": Code(
        "a signal has no bits",
        "It has no value.",
        "Give its length, or delete it.",
    ),
    "too-long": Code(
        "a message is longer than 8 bytes and no CAN FD message",
        "Classical CAN has no such frame: it will never be seen.",
        "Correct the length, or set VFrameFormat to StandardCAN_FD or ExtendedCAN_FD.",
    ),
    "fd-length": Code(
        "a CAN FD message has a length that no frame has",
        "Frames have 0 … 8, 12, 16, 20, 24, 32, 48 or 64 bytes: every one has another length than stated.",
        "Give the padded length.",
    ),
    "fd-input": Code(
        "what looks like an input lies in a CAN FD message",
        "It is read only where interface and controller give FD frames.",
        "Check with `ip -details link` that the controller does CAN FD.",
    ),
    "multiplexed-input": Code(
        "what looks like an input is multiplexed",
        "It is there only in some of the frames: its own cycle is longer than the message's.",
        "Have it sent in every frame, or state its time-out by GenSigTimeoutTime or `timeout_ms`.",
    ),
    # numbers
    "factor-zero": Code(
        "a signal's factor is 0",
        "Every frame gives the same value.",
        "Give the factor.",
    ),
    "range-reversed": Code(
        "minimum is greater than maximum",
        "Every value is out of range, so every frame is rejected.",
        "Exchange them.",
    ),
    "range-beyond-field": Code(
        "the range is wider than what the bits can hold",
        "The range guards nothing, and a true value beyond the bits wraps around.",
        "Narrow the range, or correct length, sign, factor or offset.",
    ),
    "no-range": Code(
        "what looks like an input has no range, [0|0]",
        "A broken value cannot be told from a true one.",
        "State [min|max] of the sensor, or `range` in the configuration.",
    ),
    "start-value-out-of-range": Code(
        "the start value is neither in the range nor a named value, or the bits cannot hold it",
        "What a sender puts out before its first measurement is decoded as something else.",
        "Correct GenSigStartValue: a raw value, best the one that means not available.",
    ),
    "float-width": Code(
        "a floating-point signal has neither 16, 32 nor 64 bits",
        "There is no such number: the first frame cannot be decoded.",
        "Correct its length, or SIG_VALTYPE_.",
    ),
    # words
    "value-beyond-width": Code(
        "a named value has more bits than the signal",
        "It can never be sent: where it means not available, a sensor can't say so.",
        "Name the raw value that the bits hold (two's complement where signed).",
    ),
    "value-named-twice": Code(
        "a value table names one raw value twice",
        "The later word holds; the earlier may have been the one that was meant.",
        "Leave one of them.",
    ),
    "sentinel-in-range": Code(
        "a word for 'no measurement' names a value within [min|max]",
        "A true measurement of that value is taken for none, or the other way round.",
        "Move the word outside the range, or narrow the range by one step.",
    ),
    "status-words-unknown": Code(
        "a status has words of failure, but none that is known to be good",
        "`wrcd check` refuses to guess which one lets a value pass.",
        'Say it in the configuration: `status = "Message.Signal"`, `ok = ["…"]`.',
    ),
    "no-way-to-fail": Code(
        "an input has no status, and no word for 'no measurement'",
        "A broken sensor's value is taken for a measurement until plausibility finds it out, which takes seconds.",
        "Add a status or a named value; name a known raw value by `invalid` in the configuration.",
    ),
    "no-room-for-not-available": Code(
        "every raw value of a field for adhesion is an adhesion",
        "Where there is no estimate the field would say one. `wrcd check` refuses it.",
        "Leave a raw value outside [min|max], and name it NotAvailable.",
    ),
    # times
    "no-cycle": Code(
        "a message with an input, or with adhesion, has no cycle",
        "Its time-out is then 100 ms, and losses cannot be counted.",
        "Set GenMsgCycleTime, or `timeout_ms` (an input), `cycle_ms` (an output) in the configuration.",
    ),
    "cyclic-without-cycle": Code(
        "the send type is cyclic, but the cycle is 0",
        "Nothing says when a frame is late.",
        "Set GenMsgCycleTime, or another GenMsgSendType.",
    ),
    "cycle-no-time": Code(
        "a cycle or time-out is no time from 1 to 65535 ms",
        "`wrcd check` refuses the message.",
        "Give whole milliseconds.",
    ),
    "no-timeout": Code(
        "an input other than gyro and accelerometer has a cycle, but no time-out",
        "Three cycles are taken, whatever its sender means by late.",
        "Set GenSigTimeoutTime, or `timeout_ms` in the configuration.",
    ),
    "timeout-below-cycle": Code(
        "a time-out is shorter than the cycle",
        "The input is stale before its next frame can come: the axle is never Valid.",
        "Give two cycles at least.",
    ),
    "cycle-above-tick": Code(
        "gyro or accelerometer comes more slowly than the estimator ticks",
        "The filters need a measurement at every tick. `wrcd check` refuses it.",
        "Have it sent every tick, or make a design for a longer tick.",
    ),
    # E2E
    "e2e-unknown-profile": Code(
        "E2E by a profile other than P11",
        "`wrcd check` refuses the message: an unchecked frame must not look checked.",
        'Correct E2EProfile; `e2e = "none"` in the configuration reads it unchecked.',
    ),
    "e2e-no-data-id": Code(
        "an E2E profile without a data id of 0 … 65535",
        "The CRC cannot be computed.",
        "Set E2EDataId, or `data_id` in the configuration.",
    ),
    "e2e-data-id-twice": Code(
        "two messages have one E2E data id",
        "A frame of one passes as the other: just what the data id is to find.",
        "Give each its own.",
    ),
    "e2e-too-short": Code(
        "an E2E message has fewer than two bytes",
        "CRC and counter take twelve bits.",
        "Correct the length or the profile.",
    ),
    "e2e-overlap": Code(
        "a signal lies in byte 0 or the low half of byte 1 of an E2E message",
        "There the CRC and the counter are: the signal is overwritten.",
        "Move the signal, or take the profile away.",
    ),
    "e2e-partly": Code(
        "an input or output has no E2E, while others have",
        "What is not protected passes repeated, swapped and damaged frames.",
        "Protect it, or accept it knowingly.",
    ),
    # what is in the file
    "ground-truth": Code(
        "a production file has ground truth",
        "Only a rig knows the truth. A receiver that comes to rely on it finds nothing on the train.",
        "Keep it in a DBC of the rig's own.",
    ),
    # for the estimator
    "unit-missing": Code(
        "what looks like an input has no unit",
        "`wrcd check` refuses it: deg/s taken for rad/s is wrong by a factor of 57.",
        "Write the unit, or `unit` in the configuration.",
    ),
    "unit-unknown": Code(
        "what is named like an input has a unit that cannot be converted",
        "`wrcd check` refuses it.",
        "Correct the unit's text, or `unit` and `scale` in the configuration.",
    ),
    "one-sided": Code(
        "what has two signs has a range from 0 on",
        "Yaw rate, lateral acceleration and torque change sign: half of the values are lost.",
        "Make it signed, or give an offset.",
    ),
    "resolution-too-coarse": Code(
        "a measurement's step is coarser than the noise that the design expects",
        "The residuals then show the steps, not the wheelset; a sensor that repeats itself looks frozen.",
        "Give it more bits, or make a design with this sensor's noise.",
    ),
    "range-too-small": Code(
        "a measurement's range is smaller than what the rig's runs reach",
        "A sensor at its limit is rejected just when the wheelset moves most.",
        "Widen the range.",
    ),
}
