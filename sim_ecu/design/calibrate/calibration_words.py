"""What a calibration says to a person: what it used, what it found, what it cannot tell, and what to record for it."""

import math
from collections.abc import Iterator

from sim_ecu.design.calibrate.calibration import NEEDED, SUSPICIOUS, Calibration
from sim_ecu.play.scenario_keys import PARAMETERS, VEHICLE_PARAMETERS
from wrcd.fit.stretches import OVERLAP, STRETCH_S, LeftOut
from wrcd.fit.whittle import UNKNOWNS

KEYS = {key.name: key for key in (*PARAMETERS, *VEHICLE_PARAMETERS)}
WORDS = {
    "gamma": "conicity", "primary_yaw_N_m_rad": "primary yaw stiffness",
    "secondary_yaw_damping_N_m_s_rad": "secondary yaw damping", "primary_lateral_N_m": "primary lateral stiffness",
    "primary_lateral_damping_N_s_m": "primary lateral damping", "primary_yaw_damping_N_m_s_rad": "primary yaw damping",
    "secondary_lateral_N_m": "secondary lateral stiffness", "secondary_yaw_N_m_rad": "secondary yaw stiffness",
    "secondary_lateral_damping_N_s_m": "secondary lateral damping", "m_w": "mass of a wheelset",
    "I_w": "its yaw inertia", "frame_mass_kg": "mass of the frame", "frame_yaw_inertia_kg_m2": "its yaw inertia",
    "r_0": "wheel radius",
}  # fmt: skip
# From so much on a sensor is reported, if it is beyond doubt
LEAD_S, ASKEW_RAD, GAIN, LATE_S, SPEED, NOISE_TIMES = 0.002, 0.009, 0.03, 0.002, 0.01, 3.0
# of calm stretches, to be recorded; then the track, or the bogie, tells too little
MAX_MINUTES, NEVER = 120.0, "no length of such running is enough: record other track"
ODD_SPEED = 0.035  # a speed is off by up to 3 % on worn wheels
ADVICE = {
    LeftOut.CURVE: "record straight, smoother lines", LeftOut.UNSTEADY: "record steady running",
    LeftOut.SLOW: "record faster running", LeftOut.PULSE: "record welded, smoother track",
    LeftOut.INPUTS: "`wrcd check --log` says why inputs are missing", LeftOut.GAP: "record without gaps",
    LeftOut.ALONE: "hold a speed for longer", LeftOut.MISFIT: "record smoother track",
}  # fmt: skip


def used(c: Calibration) -> list[str]:
    """What was used, and what was left out for what."""
    b = c.blocks if c.fit is None else c.fit.blocks
    speeds = f", at {b.speed_m_s.min():.0f} to {b.speed_m_s.max():.0f} m/s" if len(b) else ""
    lines = [f"{c.stretches} stretches of {STRETCH_S:.1f} s used (they overlap by half){speeds}"]
    return lines + [f"  {n:4} left out: {reason.value}" for reason, n in c.left_out.most_common() if n]


def constants(c: Calibration) -> Iterator[tuple[str, float, str, str]]:
    """Of each constant its key, value, 90 % interval in words, and a remark."""
    found = c.wheelset.numbers() | {n: getattr(c.wheelset.bogie, n) for n in KEYS if hasattr(c.wheelset.bogie, n)}
    for name in WORDS:
        ends = c.intervals.get(name)
        yield name, found[name], f"{ends[0]:.4g} to {ends[1]:.4g}" if ends else "", _remark(c, name)


def _remark(c: Calibration, name: str) -> str:
    if not c.is_told(name):
        return "is not known from this" + f": within {100 * NEEDED.get(name, 0):.0f} % is needed" * (name in NEEDED)
    if name in c.lacking:
        return f"not known well enough: within {100 * NEEDED[name]:.0f} % is needed"
    return "known well enough" if name in NEEDED else ""


def constant_lines(c: Calibration) -> list[str]:
    """The same as lines."""
    return [
        f"  {WORDS[name]:29} {value:9.4g} {KEYS[name].unit:11} {f'({ends})' if ends else ''}  {remark}".rstrip()
        for name, value, ends, remark in constants(c)
    ]


def to_record(c: Calibration) -> list[str]:
    """What would make known well enough what is not."""
    lines = []
    if c.lacking and not c.refused:
        names = ", ".join(WORDS[n] for n in c.lacking)
        minutes = max(c.lacking.values()) ** 2 * c.stretches * (1 - OVERLAP) * STRETCH_S / 60
        until = f"record until there are some {minutes:.0f} minutes of calm stretches, at several speeds"
        lines += [f"for {names} {until if minutes < MAX_MINUTES else NEVER}"]
        if c.fit is not None and c.fit.incoherence > SUSPICIOUS:
            lines += ["the signals are more incoherent than usual: smoother track would tell more"]
    most = c.left_out.most_common(1)
    if (c.fit is None or lines) and most and most[0][1] > c.stretches:
        lines += [f"most was left out for: {most[0][0].value}; {ADVICE[most[0][0]]}"]
    return lines


def sensors(c: Calibration) -> list[str]:
    """What is wrong with them, beyond doubt."""
    assert c.fit is not None
    fit, x, lines = c.fit, c.fit.logs, []

    def sure(name: str, least: float) -> bool:
        k = UNKNOWNS.index(name)
        return abs(x[name]) > least + 2 * math.sqrt(fit.covariance[k, k])

    for k, which in ((1, "leading"), (2, "trailing")):
        if sure(f"lead_{k}", LEAD_S):
            ms = 1e3 * x[f"lead_{k}"]
            order = "before" if ms > 0 else "after"
            lines += [f"{which} axle: the accelerometer is read {abs(ms):.1f} ms {order} the gyro"]
        if sure(f"askew_{k}", ASKEW_RAD):
            lines += [f"{which} axle: the gyro's axis is askew by {math.degrees(x[f'askew_{k}']):+.1f} degrees"]
        if sure(f"gyro_gain_{k}", GAIN):
            lines += [f"{which} axle: the gyro reads {100 * math.expm1(x[f'gyro_gain_{k}']):+.0f} %"]
        if sure(f"gain_{k}", GAIN):
            lines += [f"{which} axle: the accelerometer reads {100 * math.expm1(x[f'gain_{k}']):+.0f} %"]
        for sensor, what in (("yaw", "gyro"), ("lateral", "accelerometer")):
            if x[f"{sensor}_noise_{k}"] > math.log(NOISE_TIMES):
                times = math.exp(x[f"{sensor}_noise_{k}"])
                lines += [f"{which} axle: the {what} is {times:.0f} times as noisy as usual; constants may be off"]
    if sure("late", LATE_S):
        lines += [f"the trailing axle's clock is {1e3 * x['late']:+.1f} ms late against the leading one's"]
    if sure("speed_scale", SPEED):
        lines += [f"the speed reads {100 * math.expm1(-x['speed_scale']):+.1f} %"]
    if abs(x["speed_scale"]) > ODD_SPEED:
        lines += ["so wrong a speed is rare: a wrong wheelbase looks the same, and puts the constants off"]
    return lines
