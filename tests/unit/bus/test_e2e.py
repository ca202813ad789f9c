import csv
import itertools
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.can_ids import ADHESION_A1, YAW_RATE, YAW_RATE_A1, YAW_RATE_A2
from tests.support.stages import SuspectingChecker
from wrcd.bus.e2e import COUNTER_MODULO, crc, protect
from wrcd.bus.reasons import Reason
from wrcd.core.reading import Checker

# Counts that may be missing between two frames, frames after which a stray one is forgotten, senders that start anew.
MAX_LOST, CANDIDATE_FORGOTTEN, MAX_MOVES = 2, 4, 2
STARTS_AT_0 = 0x183  # a data id of which nothing is left in the CRC
VECTORS = Path(__file__).parents[2] / "data" / "e2e_profile11_vectors.csv"


@pytest.mark.parametrize("row", list(csv.DictReader(VECTORS.read_text().splitlines())), ids=lambda r: r["frame_hex"])
def test_known_frames_pass_crc_and_check(row: dict[str, str]) -> None:
    data, data_id = bytes.fromhex(row["frame_hex"]), int(row["data_id_hex"], 16)
    assert crc(data, data_id) == data[0]
    assert protect(b"\0" + data[1:], data_id, data[1] & 0x0F) == data
    assert Checker(data_id).check(data) is None


def test_zero_frame_has_the_known_crc() -> None:
    assert protect(bytes(8), 0x123, 0).hex() == "cc00000000000000"


@given(st.integers(0, 63))
def test_flipped_bit_fails_the_crc(bit: int) -> None:
    good = protect(bytes.fromhex("0000a1b2c3d4e5f6"), ADHESION_A1, 3)
    bad = bytearray(good)
    bad[bit // 8] ^= 1 << bit % 8
    assert Checker(ADHESION_A1).check(bytes(bad)) is Reason.CRC


def test_frame_of_another_message_fails_the_crc() -> None:
    assert Checker(YAW_RATE_A1).check(protect(bytes(5), YAW_RATE_A2, 0)) is Reason.CRC


@pytest.mark.parametrize("step", range(COUNTER_MODULO))
def test_counter_step_is_accepted_repeated_or_rejected(step: int) -> None:
    checker = Checker(ADHESION_A1)
    assert checker.check(protect(bytes(8), ADHESION_A1, 5)) is None
    got = checker.check(protect(bytes(8), ADHESION_A1, (5 + step) % COUNTER_MODULO))
    assert got is (Reason.REPEAT if step == 0 else None if step <= MAX_LOST + 1 else Reason.COUNTER)
    # after a gap one frame is refused, the next is good again
    assert checker.check(protect(bytes(8), ADHESION_A1, (6 + step) % COUNTER_MODULO)) is None


def test_counter_fifteen_is_rejected() -> None:
    frame = bytearray(8)
    frame[1] = 0x0F
    frame[0] = crc(frame, ADHESION_A1)
    assert Checker(ADHESION_A1).check(bytes(frame)) is Reason.COUNTER


def sent(counter: int, payload: int) -> bytes:
    return protect(bytes([0, 0, payload, 0, 0]), ADHESION_A1, counter % COUNTER_MODULO)


def test_frame_of_a_known_message_is_rejected_as_data_id() -> None:
    checker = Checker(YAW_RATE_A1, others=(YAW_RATE_A2, YAW_RATE[3]))
    for other in (YAW_RATE_A2, YAW_RATE[3]):
        assert checker.check(protect(bytes(5), other, 0)) is Reason.DATA_ID
    assert checker.check(protect(bytes(5), YAW_RATE[4], 0)) is Reason.CRC
    assert checker.check(protect(bytes(5), YAW_RATE_A1, 0)) is None


def test_frame_too_short_for_a_counter_is_of_nobody_or_another() -> None:
    checker = Checker(YAW_RATE_A1, others=(STARTS_AT_0,))
    starts = [crc(b"\0", data_id) for data_id in (YAW_RATE_A1, STARTS_AT_0, YAW_RATE_A2)]
    assert [checker.check(bytes([start])) for start in starts] == [Reason.CRC, Reason.DATA_ID, Reason.CRC]
    assert checker.check(b"") is Reason.CRC
    assert checker.check(protect(bytes(2), YAW_RATE_A1, 0)) is None
    assert Checker(YAW_RATE_A1).check(protect(bytes(5), STARTS_AT_0, 0)) is Reason.CRC  # no other is known


@pytest.mark.parametrize("apart", range(COUNTER_MODULO))
@pytest.mark.parametrize("first", [True, False])
def test_two_senders_are_both_rejected_from_the_third_frame(apart: int, first: bool) -> None:
    checker = SuspectingChecker(ADHESION_A1)
    for k in range(20):
        assert checker.check(sent(k, 1)) is None
    assert not checker.suspect
    verdicts = []
    for k in range(20, 60):
        pair = [sent(k, 1), sent(k + apart, 2)]
        verdicts.append([checker.check(f) for f in (pair if first else pair[::-1])])
        assert checker.suspect or k < 22
    assert all(Reason.TWO_SENDERS in pair for pair in verdicts[3:])
    assert not any(None in pair for pair in verdicts[3:])
    # the second falls silent: believed again after one turn of the counter
    after = [checker.check(sent(k, 1)) for k in range(60, 80)]
    assert after.index(None) <= COUNTER_MODULO + 1
    assert all(v is None for v in after[after.index(None) :])


def test_remaining_one_of_two_senders_is_accepted_again() -> None:
    checker = Checker(ADHESION_A1)
    for k in range(30):
        checker.check(sent(k, 1))
        checker.check(sent(k + 7, 2))
    after = [checker.check(sent(k + 7, 2)) for k in range(30, 50)]
    assert after[-1] is None
    assert after.index(None) <= COUNTER_MODULO + 2


def test_two_senders_in_uneven_order_are_rejected() -> None:
    """Two frames of one, two of the other: the chain would move back and forth for ever."""
    checker = Checker(ADHESION_A1)
    a, b = iter(range(100)), iter(range(8, 100))
    verdicts = [checker.check(sent(next(a if k // 2 % 2 else b), k), 2500 * k) for k in range(60)]
    assert Reason.TWO_SENDERS in verdicts[:12]
    assert None not in verdicts[12:]


@pytest.mark.parametrize("come", [2, 3, 5])
@pytest.mark.parametrize("lost", range(1, 2 * COUNTER_MODULO))
def test_sender_that_loses_frames_in_bursts_is_one(come: int, lost: int) -> None:
    checker, rng = Checker(ADHESION_A1), random.Random(lost)
    there = [k for k in range(2000) if k % (come + lost) < come]
    verdicts = [checker.check(sent(k, 1), 5000 * k + rng.randrange(1000)) for k in there]
    assert Reason.TWO_SENDERS not in verdicts
    assert verdicts.count(None) >= len(there) * (come - 1) / come  # the first after a burst


@pytest.mark.parametrize("lost", [0, 3, 4])
@pytest.mark.parametrize("apart", range(COUNTER_MODULO))
def test_two_senders_are_told_by_their_stamps_too(apart: int, lost: int) -> None:
    """Even where the receiver loses frames of both."""
    checker = Checker(ADHESION_A1)
    there = [k for k in range(400) if k % (4 + lost) < 4]
    pairs = [(sent(k, 1), 5000 * k) for k in there] + [(sent(k + apart, 2), 5000 * k + 1700) for k in there]
    verdicts = [checker.check(frame, stamp_us) for frame, stamp_us in sorted(pairs, key=lambda pair: pair[1])]
    believed = [first is None and then is None for first, then in itertools.pairwise(verdicts[20:])]
    assert not any(believed)
    if not lost:
        assert None not in verdicts[8:]


def test_repeated_frame_is_no_second_sender() -> None:
    checker = Checker(ADHESION_A1)
    for k in range(40):
        assert checker.check(sent(k, k)) is None
        assert checker.check(sent(k, k)) is Reason.REPEAT


@pytest.mark.parametrize("stray", range(COUNTER_MODULO))
def test_stray_frame_costs_at_most_one_good_frame(stray: int) -> None:
    checker = Checker(ADHESION_A1)
    for k in range(5):
        checker.check(sent(k, 1))
    checker.check(sent(stray, 99))
    refused = [k for k in range(5, 20) if checker.check(sent(k, 1)) is not None]
    assert len(refused) <= 1


def test_two_strays_on_end_cost_no_good_frame() -> None:
    """The second is taken for a sender that has started anew; the chain before it is the rival's, and goes on."""
    checker = Checker(ADHESION_A1)
    verdicts = [checker.check(sent(counter, 1)) for counter in (0, 1, 2, 8, 9, 3, 4, 5, 6, 7)]
    assert verdicts == [None, None, None, Reason.COUNTER, *6 * [None]]


def test_restarted_sender_loses_one_frame() -> None:
    checker = Checker(ADHESION_A1)
    for start in (0, 9, 3, 12):
        assert [checker.check(sent(start + k, start)) for k in range(20)].count(None) >= 19


def test_suspicion_ends_after_some_frames_of_one_sender() -> None:
    checker = SuspectingChecker(ADHESION_A1)
    for k in range(20):
        checker.check(sent(k, 1))
        if k in (10, 11):
            checker.check(sent(k + 7, 2))
        assert checker.suspect == (11 <= k <= 15)


def test_candidate_is_suspected_at_its_second_frame_then_forgotten() -> None:
    checker = SuspectingChecker(ADHESION_A1)
    for c in (0, 1, 2):
        checker.check(sent(c, 0))
    assert (checker.check(sent(9, 0)), checker.suspect) == (Reason.COUNTER, False)
    assert checker.check(sent(3, 0)) is None
    assert (checker.check(sent(10, 0)), checker.suspect) == (Reason.COUNTER, True)
    for k in range(CANDIDATE_FORGOTTEN + 1):
        assert checker.suspect
        assert checker.check(sent(4 + k, 0)) is None
    assert not checker.suspect


def test_sender_restarting_more_than_max_moves_times_counts_as_two() -> None:
    checker = Checker(ADHESION_A1)
    assert [checker.check(sent(c, 0)) for c in (0, 1, 2)] == [None] * 3
    starts = (9, 7, 0)  # none continues the chain or the one before it
    assert len(starts) == MAX_MOVES + 1
    verdicts = [(checker.check(sent(s, 0)), checker.check(sent(s + 1, 0))) for s in starts]
    assert verdicts[:-1] == [(Reason.COUNTER, None)] * MAX_MOVES
    assert verdicts[-1][1] is Reason.TWO_SENDERS


@pytest.mark.parametrize(
    ("runs", "refused"), [(20 * [6], 20), (20 * [5], 6), (20 * [4], 4), (20 * [3], 3), ([20, 20, *18 * [4]], 5)]
)
def test_sender_that_restarts_for_ever_is_one_if_it_runs_for_six_frames_between(runs: list[int], refused: int) -> None:
    """Of which the second is the move, and four more make good for it. refused: the restart that is one too many."""
    checker, counter, found = Checker(ADHESION_A1), 0, list[set[Reason | None]]()
    for frames in runs:
        of_run = set()
        for _ in range(frames):
            counter = (counter + 1) % COUNTER_MODULO
            of_run.add(checker.check(protect(bytes(8), ADHESION_A1, counter)))
        found.append(of_run)
        counter += 7
    assert found[:refused] == [{None}, *(refused - 1) * [{None, Reason.COUNTER}]]
    assert all(Reason.TWO_SENDERS in of_run for of_run in found[refused:])


@pytest.mark.parametrize(("member", "senders"), [("candidate_frames", "ab"), ("moves", "aabb")])
def test_two_senders_are_refused_for_years(member: str, senders: str) -> None:
    """From a billion frames on."""
    checker, counters = Checker(ADHESION_A1), {"a": 0, "b": 7}

    def run(rounds: int) -> set[Reason | None]:
        found = set()
        for one in rounds * senders:
            counters[one] = (counters[one] + 1) % COUNTER_MODULO
            found.add(checker.check(protect(bytes(8), ADHESION_A1, counters[one])))
        return found

    run(60)
    if member == "moves":
        checker.state[member] = (1 << 31) - 2
    else:
        assert checker.state[member] <= 3
    assert run(60) == {Reason.TWO_SENDERS}
    assert checker.state[member] > 0
