"""The tables of fusion along the vehicle."""

from typing import Any

from sim_ecu.score.tables import fig, pct


def tables(result: dict[str, Any]) -> list[str]:
    """Markdown, line by line."""
    patches, axles = result["patches"], result["axles"]
    never = ", ".join(str(f["never_there"]) for f in axles.values())
    out = [
        f"**fusion**: {patches['asked'] + patches['held']} patches of low rail, passed by four axles; what axles 2 "
        f"to 4 were told in the last frame before they were on it. On {patches['held']} of them the driver always asks "
        f"for less than they carry. Patches that an axle never came to: {never}.",
        "",
        "| axle | warned before | by (median), s | confirmed | adhesion told | its error, pp | bias, pp "
        "| error of Distance (median), m | 95 % of it, m |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, axle in axles.items():
        f = axle["all"]
        cells = [pct(f["warned"]), fig(f["lead_s"]), pct(f["confirmed"]), pct(f["told"]), fig(f["error_pp"]),
                 fig(f["bias_pp"]), fig(f["distance_m"]), fig(f["distance_p95_m"])]  # fmt: skip
        out.append(f"| {name} | " + " | ".join(cells) + " |")
    return [*out, "", *_parts(axles), "", *_for_nothing(result), "", *_goals(result["goals"])]


def _parts(axles: dict[str, Any]) -> list[str]:
    out = ["| warned before, of | " + " | ".join(f"axle {a}" for a in axles) + " |", "|---|" + "---|" * len(axles)]
    first = next(iter(axles.values()))
    for kind, unit in (("speeds", " m/s"), ("groups", "")):
        for name in first[kind]:
            cells = [f"{pct(f[kind][name]['warned'])} of {f[kind][name]['warned'].count}" for f in axles.values()]
            out.append(f"| {name}{unit} | " + " | ".join(cells) + " |")
    return out


def _for_nothing(result: dict[str, Any]) -> list[str]:
    low = result["false_lows"]
    out = ["| false warnings of a train | hours | count | an hour | seconds |", "|---|---|---|---|---|"]
    for kind, f in result["false_warnings"].items():
        out.append(f"| {kind} | {f['hours']:.3f} | {f['count']} | {fig(f['per_hour'])} | {f['seconds']:.2f} |")
    return [
        *out,
        "",
        f"Frames falsely called low: {low['adhesion']} of Adhesion, with fusion and without; {low['ahead']} of "
        f"AdhesionAhead, of {low['ahead_told_low']} that told low adhesion at a place that the axle then came to. "
        "Adhesion frames with fusion and without are "
        + ("the same bytes." if result["same_frames"] else "NOT the same."),
    ]


def _goals(goals: list[dict[str, Any]]) -> list[str]:
    out = ["| goal | value | bound | |", "|---|---|---|---|"]
    for goal in goals:
        sign = "≥" if goal["at_least"] else "≤"
        out.append(f"| {goal['what']} | {fig(goal['figure'], 3)} | {sign} {goal['bound']:g} | {goal['verdict']} |")
    return out
