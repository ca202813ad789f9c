"""What a real axle box feels and the track's spectrum lacks; and slow or coasting wheelsets."""

from collections.abc import Iterator

from sim_ecu.physics.axlebox import AxleBox
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.score.suites.nominal import Variant, condition, spread
from sim_ecu.score.suites.run import TEST, Lot, Run

WHITE_HZ = (0.0, 100.0)
# What is judged: against the nominal error (within the bound that the band and the pulses leave), or by points.
VIBRATION = tuple(
    Variant(f"vibration of {a:g} m/s², 20 to 100 Hz", box=AxleBox(vibration_m_s2=a)) for a in (0.03, 0.1, 0.3, 1.0)
)
JOINTS = tuple(
    Variant(f"joints of {a:g} m/s², {shape}", box=AxleBox(joint_m_s2=a, joint_shape=shape))
    for a in (0.3, 2.0)
    for shape in ("bipolar", "unipolar")
)
WHITE = {
    a: Variant(f"white vibration of {a:g} m/s²", box=AxleBox(vibration_m_s2=a, band_hz=WHITE_HZ))
    for a in (0.03, 0.1)
}  # fmt: skip
# Beyond what an estimate is asked for: there it must not be Valid and wrong.
BEYOND = (
    Variant("white vibration of 0.3 m/s²", box=AxleBox(vibration_m_s2=0.3, band_hz=WHITE_HZ)),
    Variant("joints of 5 m/s², bipolar", box=AxleBox(joint_m_s2=5.0)),
    Variant(
        "joints of 2 m/s² every 8 m, unipolar", box=AxleBox(joint_m_s2=2.0, joint_every_m=8.0, joint_shape="unipolar")
    ),
)
CROSSING = Variant("a crossing of 2 m/s²", box=AxleBox(crossing_m_s2=2.0, crossing_at_m=100.0))
HARSH = (*VIBRATION, *JOINTS, *WHITE.values(), CROSSING, *BEYOND)
HARSH_RUNS = 10  # of each
SLOW = (
    Variant("coasting, 10 to 50 m/s", utilisations=(0.0, 0.0)),
    Variant("3 to 10 m/s", speeds=(3.2, 10.0)),
)
SLOW_RUNS = 14


def harsh(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Some of the grid, with vibration, joints every 25 m and a crossing."""
    for k, variant in enumerate(HARSH):
        yield from (condition("harsh", w, n, variant, lot=lot) for n in spread(scale, HARSH_RUNS, 30 + k))


def slow(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Without torque, and below the grid's speeds."""
    for k, variant in enumerate(SLOW):
        yield from (condition("slow", w, n, variant, lot=lot) for n in spread(scale, SLOW_RUNS, 50 + k))
