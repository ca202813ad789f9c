"""`wrcd check`: what a configuration would run."""

from wrcd.bus.dbc import find_message, find_signal
from wrcd.bus.signals import Output
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.core.validity import LOAD_SHARES, RADIUS_SHARES
from wrcd.estimator.design import Design

# what of a wheelset a person knows it by, as the rig names it
KNOWN_BY = (
    ("r_0", "wheel radius", "m"),
    ("gamma", "conicity", ""),
    ("m_w", "mass", "kg"),
    ("k_w", "yaw stiffness", "N·m/rad"),
)


def describe(c: Config) -> list[str]:
    """Lines for a person."""
    d = c.design
    out = [
        f"configuration  {c.file}",
        f"bus            {c.interface} {c.channel}",
        f"DBC            {c.dbc_file} ({len(c.database.messages)} messages)",
        f"design         {c.design_file}: {d.name}, {d.checksum[:12]}, {len(d.rules)} rules",
        f"               tick {1000 * d.tick_s:g} ms, window {d.window_s:g} s, "
        f"{d.speeds_m_s[0]:g} … {d.speeds_m_s[-1]:g} m/s",
        f"               models: {'; '.join(d.model_names)}",
        f"wheelset       {_wheelset(d)}",
        f"limits         not available after {c.not_available_after_us / 1000:g} ms and below {c.min_speed_m_s:g} m/s"
        + (f", constant speed {c.constant_speed_m_s:g} m/s" if c.constant_speed_m_s is not None else ""),
    ]
    for place, axle in enumerate(c.axles):
        out.append(f"axle {axle.number}")
        for i in c.inputs:
            if place in i.source.axles:
                m = find_message(c.database, i.source.message)
                unit = find_signal(m, i.source.signal).unit or "no unit"
                out.append(
                    f"  {i.source.quantity.key:22} <- 0x{m.frame_id:03X} {m.name}.{i.source.signal} ({unit}), "
                    f"stale after {i.timeout_us / 1000:g} ms{_bounds(i.source.quantity, c.design)}"
                )
        out += [f"  sends                  -> {_sent(c, o)}" for o in (axle.adhesion, axle.detail, axle.inputs) if o]
    out += [f"status                   -> {_sent(c, o)}" for o in (c.status, c.rejects, c.link) if o]
    r = c.recorder
    out.append(
        f"recorder       the last {r.seconds:g} s, dumps in {r.folder} (at most {r.max_files}, {r.max_mb:g} MB)"
        if r.on
        else "recorder       none" + (" ([recorder] names no folder)" if r.folder is None else "")
    )
    out.append("ok")
    return out


def _sent(c: Config, o: Output) -> str:
    return f"0x{find_message(c.database, o.message).frame_id:03X} {o.message}, every {o.cycle_us / 1000:g} ms"


def _wheelset(d: Design) -> str:
    """What the design is for: nothing in the signals tells a foreign wheelset."""
    known = [
        f"{what} {d.wheelset[key]:g} {unit}".rstrip()
        for key, what, unit in KNOWN_BY
        if isinstance(d.wheelset.get(key), int | float)
    ]
    return f"{d.wheelset.get('name', d.name)}: {', '.join((f'axle load {2e-3 * d.normal_N:.4g} kN', *known))}"


def _bounds(quantity: Quantity, d: Design) -> str:
    if quantity is Quantity.AXLE_LOAD:
        return "; Degraded outside {:.4g} … {:.4g} kN".format(*(2e-3 * d.normal_N * s for s in LOAD_SHARES))
    if quantity is Quantity.WHEEL_RADIUS:
        return "; Degraded outside {:.3g} … {:.3g} m".format(*(d.r_0 * s for s in RADIUS_SHARES))
    return ""
