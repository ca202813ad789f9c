"""`sim-ecu calibrate`: logs and what is known in, a vehicle's file and a page out."""

import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from sim_ecu.design.calibrate.bogie_ticks import digest, places_of, runs_of
from sim_ecu.design.calibrate.calibration import Calibration, calibrate
from sim_ecu.design.calibrate.calibration_words import constant_lines, sensors, to_record, used
from sim_ecu.design.calibrate.known_vehicle import read_known
from sim_ecu.design.calibrate.vehicle_file import vehicle_text
from sim_ecu.play.suspension import conversions
from sim_ecu.reporting.result_files import check_output, save
from wrcd.config.config import load_config
from wrcd.config.settings import read_toml, read_whole
from wrcd.errors import InputError, Status, need
from wrcd.logs.replay_outputs import check_output as not_an_input
from wrcd.progress import Progress


def run(
    logs: Sequence[Path], known_file: Path, output: Path, *, config_file: Path | None = None,
    axles: Sequence[int] = (), channel: str | None = None, page: Path | None = None,
) -> int:  # fmt: skip
    """Calibrate, print what came of it, write the files. Returns STOPPED where it refuses. Raises InputError."""
    check_output("-o", output)
    check_output("--html", page)
    read_too = [*logs, known_file, config_file]
    not_an_input(output, read_too)
    if page is not None:
        not_an_input(page, [*read_too, output], "--html")
        need(("matplotlib",), "report", "--html")
    known = read_whole(known_file, lambda top, _: read_known(top))
    for line in conversions(read_toml(known_file)):
        print(line)
    config = load_config(config_file)
    places = places_of(config, axles)
    digests = [(log.name, digest(log)) for log in logs]
    if twice := [name for k, (name, of) in enumerate(digests) if of in [d for _, d in digests[:k]]]:
        raise InputError("is given twice", file=twice[0], hint="leave it out: it would count as two")
    runs = runs_of(logs, config, places, channel)
    progress = Progress()
    try:
        found = calibrate(runs, known, lambda step: progress.at(f"step {step} of the fit"))
    finally:
        progress.end()
    print("\n".join(lines(found)))
    if page is not None:
        from sim_ecu.design.calibrate.calibration_page import page_of

        text = page_of(found, [log.name for log in logs])
        save(page, lambda partly: partly.write_text(text, encoding="utf-8"))
        print(f"{page}: measured and fitted spectra")
    if found.refused:
        print(f"sim-ecu: refused: {found.refused}; {output} is not written", file=sys.stderr)
        return Status.STOPPED
    text_of_vehicle = vehicle_text(found, output.stem, digests, datetime.now(UTC).date())
    save(output, lambda partly: partly.write_text(text_of_vehicle, encoding="utf-8"))
    print(f"{output}: sim-ecu design --config {output} -o {output.stem}.design.json")
    return Status.DONE


def lines(c: Calibration) -> list[str]:
    """What is printed."""
    out = used(c)
    if c.fit is not None:
        out += [f"incoherent by {100 * c.fit.incoherence:.1f} %: what neither track nor noise explains"]
        out += [] if c.refused else [*constant_lines(c), *sensors(c)]
    return out + to_record(c)
