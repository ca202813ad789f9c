"""What lint can find: a stable word for each, why it matters, how to mend it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Code:
    """A kind of fault."""

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
        "Nothing of it can be used.",
        "Mend what the message names; what else is found is below.",
    ),
    "byte-order-mark": Code(
        "Other tools call it a syntax error.",
        "Save the file without it.",
    ),
    "non-ascii-unit": Code(
        "A DBC states no encoding: what one tool writes as m/s², another reads as m/sÂ².",
        "Write m/s2, deg/s, N.m, Ohm. In the configuration: `unit`, or `encoding` under [dbc].",
    ),
    "unknown-reference": Code(
        "Loading drops it in silence: words, times or E2E that somebody meant are not in force.",
        "Correct the id or the name, or delete the statement.",
    ),
    # the layout of frames
    "duplicate-id": Code(
        "Only one of them is decoded, the other's frames are read as the wrong signals.",
        "Give each its own id; two layouts of one message are multiplexed signals.",
    ),
    "duplicate-message": Code(
        "A configuration names messages: the later hides the earlier.",
        "Rename one of them.",
    ),
    "duplicate-signal": Code(
        "`wrcd check` refuses the message: which of them is meant is open.",
        "Rename one of them.",
    ),
    "impossible-id": Code(
        "No frame has it. An extended id without the DBC's mark of one (2147483648) looks so.",
        "Correct the id, or add the mark.",
    ),
    "undeclared-sender": Code(
        "It is a typing error, or the node was deleted and its messages are no longer sent.",
        "Name the node under BU_, or write Vector__XXX.",
    ),
    "undeclared-receiver": Code(
        "It is a typing error, or the node was deleted.",
        "Name the node under BU_, or write Vector__XXX.",
    ),
    "signal-outside-message": Code(
        "No frame carries it. Strict loading refuses the file.",
        "Correct start, length or byte order, or the message's length.",
    ),
    "signals-overlap": Code(
        "At least one of them is wrong in every frame. Strict loading refuses the file.",
        "Correct start, length or byte order; signals that take turns are multiplexed.",
    ),
    "no-bits": Code(
        "It has no value.",
        "Give its length, or delete it.",
    ),
    "too-long": Code(
        "Classical CAN has no such frame: it will never be seen.",
        "Correct the length, or set VFrameFormat to StandardCAN_FD or ExtendedCAN_FD.",
    ),
    "fd-length": Code(
        "Frames have 0 … 8, 12, 16, 20, 24, 32, 48 or 64 bytes: every one has another length than stated.",
        "Give the padded length.",
    ),
    "fd-input": Code(
        "It is read only where interface and controller give FD frames.",
        "Check with `ip -details link` that the controller does CAN FD.",
    ),
    "multiplexed-input": Code(
        "It is there only in some of the frames: its own cycle is longer than the message's.",
        "Have it sent in every frame, or state its time-out by GenSigTimeoutTime or `timeout_ms`.",
    ),
    "j1939-id": Code(
        "Ids are matched whole, source address and priority too: another sender's frames of the group are not read.",
        "Give the id that the sender has on the bus, or write `pgn = true` in the configuration.",
    ),
    # numbers
    "factor-zero": Code(
        "Every frame gives the same value.",
        "Give the factor.",
    ),
    "range-reversed": Code(
        "Every value is out of range, so every frame is rejected.",
        "Exchange them.",
    ),
    "range-beyond-field": Code(
        "The range guards nothing, and a true value beyond the bits wraps around.",
        "Narrow the range, or correct length, sign, factor or offset.",
    ),
    "no-range": Code(
        "A broken value looks like a true one.",
        "State [min|max] of the sensor, or `range` in the configuration.",
    ),
    "start-value-out-of-range": Code(
        "What a sender puts out before its first measurement is decoded as something else.",
        "Correct GenSigStartValue: a raw value, best the one that means not available.",
    ),
    "float-width": Code(
        "There is no such number: the first frame cannot be decoded.",
        "Correct its length, or SIG_VALTYPE_.",
    ),
    # words
    "value-beyond-width": Code(
        "It can never be sent: where it means not available, a sensor can't say so.",
        "Name the raw value that the bits hold (two's complement where signed).",
    ),
    "value-named-twice": Code(
        "The later word holds; the earlier may have been the one that was meant.",
        "Leave one of them.",
    ),
    "sentinel-in-range": Code(
        "A true measurement of that value is taken for none, or the other way round.",
        "Move the word outside the range, or narrow the range by one step.",
    ),
    "status-words-unknown": Code(
        "`wrcd check` refuses to guess which one lets a value pass.",
        'Say it in the configuration: `status = "Message.Signal"`, `ok = ["…"]`.',
    ),
    "no-way-to-fail": Code(
        "A broken sensor's value is taken for a measurement until plausibility finds it out, which takes seconds.",
        "Add a status or a named value; name a known raw value by `invalid` in the configuration.",
    ),
    "no-room-for-not-available": Code(
        "Where there is no estimate the field would say one. `wrcd check` refuses it.",
        "Leave a raw value outside [min|max], and name it NotAvailable.",
    ),
    # times
    "no-cycle": Code(
        "Its time-out is then 100 ms, and losses cannot be counted.",
        "Set GenMsgCycleTime, or `timeout_ms` (an input), `cycle_ms` (an output) in the configuration.",
    ),
    "cyclic-without-cycle": Code(
        "Nothing says when a frame is late.",
        "Set GenMsgCycleTime, or another GenMsgSendType.",
    ),
    "cycle-no-time": Code(
        "`wrcd check` refuses the message.",
        "Give whole milliseconds.",
    ),
    "no-timeout": Code(
        "Three cycles are taken, whatever its sender means by late.",
        "Set GenSigTimeoutTime, or `timeout_ms` in the configuration.",
    ),
    "timeout-below-cycle": Code(
        "The input is stale before its next frame can come: the axle is never Valid.",
        "Give two cycles at least.",
    ),
    "cycle-above-tick": Code(
        "The filters need a measurement at every tick. `wrcd check` refuses it.",
        "Have it sent every tick, or make a design for a longer tick.",
    ),
    # E2E
    "e2e-unknown-profile": Code(
        "`wrcd check` refuses the message: an unchecked frame must not look checked.",
        'Correct E2EProfile; `e2e = "none"` in the configuration reads it unchecked.',
    ),
    "e2e-no-data-id": Code(
        "The CRC cannot be computed.",
        "Set E2EDataId, or `data_id` in the configuration.",
    ),
    "e2e-data-id-twice": Code(
        "A frame of one passes as the other: just what the data id is to find.",
        "Give each its own.",
    ),
    "e2e-too-short": Code(
        "CRC and counter take twelve bits.",
        "Correct the length or the profile.",
    ),
    "e2e-overlap": Code(
        "There the CRC and the counter are: the signal is overwritten.",
        "Move the signal, or take the profile away.",
    ),
    "e2e-partly": Code(
        "What is not protected passes repeated, swapped and damaged frames.",
        "Protect it, or accept it knowingly.",
    ),
    # what is in the file
    "ground-truth": Code(
        "Only a rig knows the truth. A receiver that comes to rely on it finds nothing on the train.",
        "Keep it in a DBC of the rig's own.",
    ),
    # for the estimator
    "unit-missing": Code(
        "`wrcd check` refuses it: deg/s taken for rad/s is wrong by a factor of 57.",
        "Write the unit, or `unit` in the configuration.",
    ),
    "unit-unknown": Code(
        "`wrcd check` refuses it.",
        "Correct the unit's text, or `unit` and `scale` in the configuration.",
    ),
    "one-sided": Code(
        "Yaw rate, lateral acceleration and torque change sign: half of the values are lost.",
        "Make it signed, or give an offset.",
    ),
    "resolution-too-coarse": Code(
        "The residuals then show the steps, not the wheelset; a sound sensor that repeats itself looks frozen.",
        "Give it more bits, or make a design with this sensor's noise.",
    ),
    "range-too-small": Code(
        "A sensor at its limit is rejected just when the wheelset moves most.",
        "Widen the range.",
    ),
}
