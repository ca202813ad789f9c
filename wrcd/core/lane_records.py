"""The records of the fast lane as C has them: wrcd/core/c/lane.h, in its order, and what it tells of an axle."""

import numpy as np

from wrcd.core.terms import EstimateDoubt, PairState
from wrcd.core.vocabulary import MESSAGES

MAX_CYCLES, MAX_AXLES, MAX_WORDS = 8, 8, 32
TOLD = [name for message in ("adhesion", "detail", "inputs") for name in MESSAGES[message]]  # enum wrcd_told
REPORTED = len(MESSAGES["adhesion"]) + 2  # of them, and the cause, and whether the window was short


def _fields(kind: type, names: str, *shape: int) -> list[tuple[str, type, tuple[int, ...]]]:
    return [(name, kind, shape) for name in names.split()]


_I4, _I8, _U8, _F8 = np.int32, np.int64, np.uint64, np.float64
FRAME_RECORD = np.dtype(
    [
        *_fields(_I8, "stamp_us"), *_fields(np.uint32, "word"), *_fields(np.uint8, "length flags"),
        *_fields(np.uint16, "cause"), *_fields(np.uint8, "data", 8),
    ], align=True,
)  # fmt: skip
MESSAGE = np.dtype(
    [
        *_fields(np.uint32, "word"),
        *_fields(_I4, "length is_big_endian is_plain is_protected is_suspicious first_signal signals first_ok oks"),
        *_fields(_U8, "status_bits"), *_fields(_I8, "last_us frames"), *_fields(_I4, "last crc_start"),
        *_fields(np.uint8, "payload", 8),
    ], align=True,
)  # fmt: skip
SIGNAL = np.dtype(
    [
        *_fields(_U8, "mask sign"), *_fields(_F8, "scale offset factor low high first_end last_end"),
        *_fields(_I4, "shift quantity first_place places check run"), *_fields(_F8, "value share frames max_step"),
        *_fields(_I8, "changed_us timeout_us"),
    ], align=True,
)  # fmt: skip
PLACE = np.dtype(
    [
        *_fields(_I8, "timeout_us stamp_us used_us reach_until_us traction_us"), *_fields(_F8, "value"),
        *_fields(_F8, "waiting", 2), *_fields(_I8, "waiting_us", 2),
        *_fields(_I4, "is_mapped waits surplus_ticks reach"),
    ], align=True,
)  # fmt: skip
SENT = np.dtype(
    [
        *_fields(_U8, "start"), *_fields(_I8, "cycle_us"), *_fields(np.uint32, "word"),
        *_fields(_I4, "axle length is_big_endian is_protected crc_start first_field fields"),
    ], align=True,
)  # fmt: skip
FIELD = np.dtype(
    [
        *_fields(_U8, "mask"), *_fields(_U8, "word_bits", MAX_WORDS), *_fields(_F8, "factor low high scale offset"),
        *_fields(_I8, "lowest highest not_available"), *_fields(_I4, "told shift is_word rounds is_rounded_down"),
    ], align=True,
)  # fmt: skip
SLOT = np.dtype([*_fields(_I8, "end_us"), *_fields(_F8, "told", MAX_AXLES, REPORTED)], align=True)
LANE = np.dtype(
    [
        *_fields(_I8, "open begin_us end_us stamp_us ticks accepted out_frames out_slots"),
        *_fields(_I8, "period_us silence_us forward_us backward_us"),
        *_fields(_I8, "cycle_us", MAX_CYCLES),
        *_fields(_F8, "min_speed_m_s speed_low speed_high load_N radius_m dead_Nm against_Nm"),
        *_fields(_F8, "shares", 4), *_fields(_I8, "traction_held_us"),
        *_fields(_F8, "torque_ratio", MAX_AXLES), *_fields(_F8, "z", 2 * MAX_AXLES),
        *_fields(_F8, "surface_pct confidence_pp", MAX_WORDS), *_fields(_F8, "room"),
        *_fields(_I8, "sound_ticks outlier_us inputs_cycle_us", MAX_AXLES), *_fields(_I8, "rejected_until_us"),
        *_fields(_I4, "confidence cause standing", MAX_AXLES), *_fields(_I4, "of_pair", len(PairState)),
        *_fields(_I4, "of_doubt", len(EstimateDoubt)), *_fields(_I4, "contradiction too_little_data"),
        *_fields(_I4, "surfaces confidences sent adhesions quiet window_ticks"),
        *_fields(_I4, "axles messages cycles patience is_reverse speed_tells_direction"),
        *_fields(_I4, "torque_sign_counts torque_is_total ratio_known shares_known due"),
    ], align=True,
)  # fmt: skip
