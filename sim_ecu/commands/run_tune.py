"""`sim-ecu tune`: reads where the search starts, makes the folder, and lets the stages go."""

from dataclasses import fields
from pathlib import Path

from sim_ecu.campaign.tune.go import Asked, tune
from sim_ecu.design.brief import find, read_brief
from sim_ecu.design.make import Brief
from sim_ecu.design.source import load_source
from sim_ecu.design.space import groups_of, parameters
from sim_ecu.physics.wheelset import Wheelset
from wrcd.errors import InputError
from wrcd.settings import parse_toml, read_toml


def run(
    config: Path | None, output: Path, form: str | None, over: str | None, budget: int, played: int, seed: int,
    jobs: int, against: Path | None,
) -> int:  # fmt: skip
    """Raises InputError for what cannot be searched, before any work."""
    start = read_brief(parse_toml("", "") if config is None else read_toml(find(config)), form)
    groups = groups_of(start.form) if over is None else tuple(name.strip() for name in over.split(","))
    parameters(start, groups)
    if against is not None:
        _fits(against, start)
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot be made: {e.strerror}", file=output, key="-o", hint="name a folder") from None
    return tune(Asked(start, groups, budget, played, seed, jobs, against), output)


def _fits(against: Path, start: Brief) -> None:
    source = load_source(against)
    pairs = {"tick_s": (source.design.tick_s, start.tick_s)}
    pairs |= {f.name: (getattr(source.wheelset, f.name), getattr(start.wheelset, f.name)) for f in fields(Wheelset)}
    for key, (theirs, wanted) in pairs.items():
        if theirs != wanted:
            raise InputError(
                f"has {key} = {theirs:g}, what is tuned {wanted:g}", file=against, key="--against",
                hint="only designs for the same wheelset and tick can be compared on the same frames",
            )  # fmt: skip
