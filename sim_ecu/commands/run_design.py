"""`sim-ecu design`: reads what is to be designed, shows how far it is, writes the file."""

from pathlib import Path

from sim_ecu.commands.outputs import check_output
from sim_ecu.design.brief import find, read_brief
from sim_ecu.design.make import design, write
from sim_ecu.score.learned import learn
from wrcd.estimator.design import load_design
from wrcd.settings import parse_toml, read_toml
from wrcd.tools.progress import Progress


def run(
    config: Path | None, output: Path, baselines: Path | None = None, form: str | None = None
) -> int:  # fmt: skip
    """Make a design file, and what a score compares it with. Deterministic for one set of library versions."""
    brief = read_brief(parse_toml("", "") if config is None else read_toml(find(config)), form)
    check_output("-o", output)
    check_output("--baselines", baselines)
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
