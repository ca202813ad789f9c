"""`sim-ecu design`: reads what is to be designed, shows how far it is, writes the file."""

from dataclasses import replace
from pathlib import Path

from sim_ecu.design.cases import Plan
from sim_ecu.design.make import Brief, design, write
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.play.scenario import read_wheelset
from sim_ecu.score.learned import learn
from wrcd.errors import InputError
from wrcd.estimator.design import load_design
from wrcd.settings import Section, read_toml, suggest
from wrcd.tools.progress import Progress

WHEELSETS = Path(__file__).parent / "wheelsets"


def run(config: Path | None, output: Path, baselines: Path | None = None) -> int:
    """Make a design file, and what a score compares it with. Deterministic for one set of library versions."""
    brief = Brief() if config is None else read_brief(read_toml(find(config)))
    for key, file in (("-o", output), ("--baselines", baselines)):
        if file is not None and not file.parent.is_dir():
            raise InputError("no such folder", file=file.parent, key=key)
        if file is not None and file.is_dir():
            raise InputError("is a folder", file=file, key=key, hint="name the file to write")
    progress = Progress(steps=True)
    document, recordings = design(brief, progress.at)
    write(document, output)
    if baselines is not None:
        progress.at("baselines", 0.0)
        write(learn(load_design(output), recordings, brief.plan), baselines)
    progress.end()
    fit = document["fit"]
    print(
        f"{output}: {document['name']}, {len(document['fuzzy']['rules'])} rules, checksum {document['checksum'][:12]}; "
        f"on its own {fit['windows']} training windows: mean error {fit['mean_error_pp']} pp, "
        f"p95 {fit['p95_error_pp']} pp"
    )
    return 0


def find(config: Path) -> Path:
    """A packaged wheelset by its name, or a file by its path. Raises InputError."""
    known = {p.stem: p for p in sorted(WHEELSETS.glob("*.toml"))}
    if config.suffix == ".toml":
        return config
    if str(config) not in known:
        hint = suggest(str(config), list(known)) or f"packaged: {', '.join(known)}; or give a path to a .toml file"
        raise InputError(f"there is no wheelset {str(config)!r}", key="--config", hint=hint)
    return known[str(config)]


def read_brief(top: Section) -> Brief:
    """[wheelset], [design] and [plan] of a rig's TOML file; what is not there keeps its default."""
    base, plan = Brief(), Plan()
    d, p = top.section("design"), top.section("plan")
    brief = replace(
        base,
        wheelset=read_wheelset(top.section("wheelset")),
        tick_s=d.number("tick_s", base.tick_s, 0.001, 0.02),
        window_s=d.number("window_s", base.window_s, 0.1, 10.0),
        longest_s=d.number("longest_s", base.longest_s, 0.1, 20.0),
        recent_s=d.number("recent_s", base.recent_s, 0.02, 10.0),
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
            held_share=p.number("held_share", plan.held_share, 0.0, 0.5),
            changed_share=p.number("changed_share", plan.changed_share, 0.0, 0.5),
            sensors=p.choice("sensors", SENSOR_SETS, plan.sensors),
        ),
    )
    for section, key, value, low, high in (
        (d, "grid", brief.grid, 2, 500),
        (d, "torque_sets", brief.torque_sets, 2, 15),
        (d, "most_rules", brief.most_rules, 1, 254),
        (p, "speeds", brief.plan.speeds, 2, 200),
        (p, "per_speed", brief.plan.per_speed, 2, 2_000),
        (p, "seed", brief.plan.seed, 0, 1_000),  # the score's seeds are far above
    ):
        if not low <= value <= high:
            raise section.error(f"takes a whole number from {low} to {high}, not {value}", key)
    if brief.longest_s < brief.window_s:
        raise d.error(f"must not be less than window_s = {brief.window_s:g}, is {brief.longest_s:g}", "longest_s")
    if 2 * brief.recent_s > brief.window_s:
        raise d.error(f"must not be more than half of window_s = {brief.window_s:g}, is {brief.recent_s:g}", "recent_s")
    for section in (d, p, top):
        section.done()
    return brief
