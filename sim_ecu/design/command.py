"""`sim-ecu design`: reads what is to be designed, shows how far it is, writes the file."""

from dataclasses import replace
from pathlib import Path

from sim_ecu.design.cases import Plan
from sim_ecu.design.make import Brief, design, write
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.play.scenario import read_wheelset
from wrcd.errors import InputError
from wrcd.settings import Section, read_toml
from wrcd.tools.progress import Progress


def run(config: Path | None, output: Path) -> int:
    """Make a design file. Deterministic for one set of library versions."""
    brief = Brief() if config is None else read_brief(read_toml(config))
    if not output.parent.is_dir():
        raise InputError("no such folder", file=output.parent, key="-o")
    progress = Progress(steps=True)
    document = design(brief, progress.at)
    write(document, output)
    progress.end()
    fit = document["fit"]
    print(
        f"{output}: {document['name']}, {len(document['fuzzy']['rules'])} rules, checksum {document['checksum'][:12]}; "
        f"on its own {fit['windows']} training windows: mean error {fit['mean_error_pp']} pp, "
        f"p95 {fit['p95_error_pp']} pp"
    )
    return 0


def read_brief(top: Section) -> Brief:
    """[wheelset], [design] and [plan] of a rig's TOML file; what is not there keeps its default."""
    base, plan = Brief(), Plan()
    d, p = top.section("design"), top.section("plan")
    brief = replace(
        base,
        wheelset=read_wheelset(top.section("wheelset")),
        tick_s=d.number("tick_s", base.tick_s, 0.001, 0.02),
        window_s=d.number("window_s", base.window_s, 0.1, 10.0),
        recent_s=d.number("recent_s", base.recent_s, 0.0, 10.0),
        grid=d.get("grid", int, base.grid),
        torque_sets=d.get("torque_sets", int, base.torque_sets),
        most_rules=d.get("most_rules", int, base.most_rules),
        polynomial=d.choice("polynomial", ("fitted", "paper"), base.polynomial),
        saturated_share=d.number("saturated_share", base.saturated_share, 0.1, 1.0),
        plan=replace(
            plan,
            seed=p.get("seed", int, plan.seed),
            speeds=p.get("speeds", int, plan.speeds),
            per_speed=p.get("per_speed", int, plan.per_speed),
            held_share=p.number("held_share", plan.held_share, 0.0, 1.0),
            sensors=p.choice("sensors", SENSOR_SETS, plan.sensors),
        ),
    )
    for section, key, value, low, high in (
        (d, "grid", brief.grid, 2, 500),
        (d, "torque_sets", brief.torque_sets, 2, 15),
        (d, "most_rules", brief.most_rules, 1, 254),
        (p, "speeds", brief.plan.speeds, 2, 200),
        (p, "per_speed", brief.plan.per_speed, 2, 100_000),
    ):
        if not low <= value <= high:
            raise section.error(f"takes a whole number from {low} to {high}, not {value}", key)
    for section in (d, p, top):
        section.done()
    return brief
