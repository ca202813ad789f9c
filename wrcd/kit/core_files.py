"""`wrcd kit --core`: the core in C with a configuration's tables and design, and what it makes of a track's frames."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import wrcd
from wrcd import __version__
from wrcd.bus.batch import FD_RECORD, RECORD, FrameBatch
from wrcd.bus.frame import Frame
from wrcd.bus.mapping import Mapped
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.design import FORMAT, Design
from wrcd.core.design_fit import fit_members
from wrcd.core.design_members import members
from wrcd.core.tables import tables_of
from wrcd.core.terms import COLUMNS, INPUTS, MODELS, PAIR_FEATURES, SUMS, PairState
from wrcd.core.vocabulary import snake, words_of
from wrcd.kit.c_records import TYPES, definition
from wrcd.kit.design_table import DesignTable
from wrcd.kit.files import filled, headed
from wrcd.kit.golden_frames import frames
from wrcd.kit.golden_track import shown, track

_PACKAGE = Path(wrcd.__file__).parent
_ONLY_PYTHONS = ("binding.c", "layout.c", "reading.c")
SOURCES = {
    p.name: p for p in sorted(_PACKAGE.glob("*/c/*")) if p.parts[-3] == "core" and p.name not in _ONLY_PYTHONS
} | {"wrcd_frame.h": _PACKAGE / "bus/c/wrcd_frame.h"}  # fmt: skip
_MADE = ["stamp_us", "word", "length", "flags", "cause", "data"]
MADE = ("train.h", "train.c", "vectors.h", "test_core.c", "example.c", "Makefile", "README.md")


def name_of(design: Design) -> str:
    """A design's name as it can stand in a comment and a string of C."""
    return re.sub(r"[^\w.+ -]", "_", design.name, flags=re.ASCII)


def files_of(config: Config, configuration: str) -> dict[str, bytes]:
    """Every file's bytes by its name; configuration: its checksum. The same configuration gives the same bytes."""
    design, axles = config.design, len(config.axles)
    mapped = Mapped(config.database, [i.source for i in config.inputs], config.data_ids)
    tables, of = tables_of(config, mapped), members(design)
    table, settings = DesignTable(of), tables["settings"][0]
    values = {
        "VERSION": __version__,
        "NAME": name_of(design),
        "FORMAT": FORMAT,
        "CHECKSUM": design.checksum,
        "CONFIGURATION": configuration,
        "AXLES": f"{axles}",
        "OF_AXLES": f"{axles} axle{'s' * (axles > 1)}",
        "PERIOD_US": str(settings["period_us"]),
        "MESSAGES": str(len(mapped.messages)),
        "SIGNALS": str(settings["inputs"]),
        "STATUSES": str(settings["statuses"]),
        "SENT": str(settings["sent"]),
        "LONGEST": str(of["longest"]),
        "WHEELBASE_TICKS": str(of["longest_wheelbase_ticks"]),
        "ARRAY_BYTES": str(table.array_bytes),
        "STATES": _words("STATE", words_of("status_message", "State")),
        "LINK_STATES": _words("LINK", words_of("link_message", "LinkState")),
        "SURFACES": _words("SURFACE", words_of("adhesion", "Surface")),
        "CONTACTS": _words("CONTACT", words_of("adhesion", "ContactState")),
        "CONFIDENCES": _words("CONFIDENCE", words_of("adhesion", "Confidence")),
        "TABLES": "\n".join(definition(name, tables[name], axles) for name in TYPES),
        "POINTERS": "\n".join(f"        .{name} = {name.upper()}," for name in TYPES),
        "DESIGN": table.text,
        "OBJECTS": " ".join(name.replace(".c", ".o") for name in SOURCES if name.endswith(".c")),
        **operations(design, axles),
        **_vectors(config, mapped),
    }  # fmt: skip
    # a state has room for as many axles as there are
    room = f"WRCD_MAX_AXLES = {axles},"
    bodies = {name: path.read_text().replace("WRCD_MAX_AXLES = 8,", room) for name, path in SOURCES.items()}
    bodies |= {name: filled(f"core/{name}", values) for name in MADE}
    of_what = f"{configuration}, {name_of(design)} {FORMAT} {design.checksum}"
    return {name: headed(name, body, "core", of_what) for name, body in bodies.items()}


def _words(of: str, words: Iterable[str]) -> str:
    return ", ".join(f"WRCD_{of}_{snake(word).upper()}" for word in words)


def operations(design: Design, axles: int) -> Mapping[str, str]:
    """Count multiply-adds by the design's dimensions, roughly: of a usual tick, and of one with all that may come.

    That is: samples left out, new matrices, the rules asked for the memory and an estimate, the pairs judged.
    """
    s, rules = design.states, len(design.rules)
    bank = MODELS * (s + 2) * (s + 4)
    filters = 5 * (8 * len(design.lowpass) + len(design.highpass)) + 8 * 6 + 60  # and the gate, the window's sums
    bands = 0 if design.form == "paper" else 2 * 3 * 5 + 3 * (2 + 2 + 3 + 8 + 2)
    # the window's sums, the rules, of which two sets of each input hold at once, and what those say
    asked = 9 * SUMS + INPUTS * rules + 2**INPUTS * 2 * (COLUMNS + 1) + 2 * COLUMNS
    hidden = 0 if design.health is None else len(design.health.hidden_bias)
    matrices = 2 * MODELS * (2 * (s * s + 4 * s + 4) + 4 * (s + 2))
    fit = fit_members(design)
    bogies, bins, n = (axles // 2, len(fit["basis"]) // 3, len(fit["own_sigma"])) if fit["ticks"] else (0, 0, 0)
    usual = bank + axles * (bank + filters + bands) + 2 * 4 * 2 * bins * bogies
    most = usual + matrices + axles * (bank + 2 * 2 * asked + (PAIR_FEATURES + len(PairState)) * hidden)
    # of a bin 19 responses, the derivatives by all, their products; of a block what the sum answers
    most += bogies * (19 * 4 * 212 + (n + 5) * 4 * 128 + (n + 5) ** 2 // 2 * 16 + 2 * n**3 // 3 + 5 * (n + 2) ** 2)
    return {"USUAL": f"{math.ceil(usual / 100)}00", "MOST": f"{math.ceil(most / 100)}00"}


def _vectors(config: Config, mapped: Mapped) -> dict[str, str]:
    """Frames by their ticks, and what the core makes of them: frames, figures of each adhesion, counts."""
    core, ticks = Core(config), track(config.design, len(config.axles))
    period_us = round(config.design.tick_s * 1e6)
    given, ends, made, figures = list[str](), list[str](), list[str](), list[str]()
    for k, of_tick in enumerate(frames(config, mapped, ticks)):
        end_us = (ticks.number + k + 1) * period_us
        given += _records(of_tick)
        ends.append(str(len(given)))
        core.feed(of_tick)
        out = core.advance(end_us)
        made += [_frame(*f[_MADE].item()) for f in out.frames]
        figures += [_figures(out.reports[f["report"]]) for f in out.frames if f["report"] >= 0]
    made += _records(core.shutdown_frames(end_us))
    counts = core.counts
    return {
        "DATA_BYTES": str(64 if mapped.fd else 8),
        "FIRST_TICK": str(ticks.number),
        "TICKS": str(len(ticks)),
        "FRAMES": str(len(given)),
        "OUTPUTS": str(len(made)),
        "ADHESIONS": str(len(figures)),
        "ACCEPTED": str(counts.accepted),
        "REFUSED": str(sum(counts.rejected.values())),
        "RESTARTS": str(counts.restarts),
        "GIVEN": _lines(given),
        "ENDS": _lines(", ".join(ends[k : k + 16]) for k in range(0, len(ends), 16)),
        "OUT": _lines(made),
        "FIGURES": _lines(figures),
    }


def _records(of: Sequence[Frame]) -> list[str]:
    batch = FrameBatch.of(of)
    kind = RECORD if batch.stride == RECORD.size else FD_RECORD
    return [_frame(*record) for record in kind.iter_unpack(batch.records)]


def _figures(report: Any) -> str:
    half_width_pp = report["estimate"]["half_width_pp"] if report["has_estimate"] else np.nan
    return shown(np.array([report["mu_available_pct"], half_width_pp]))


def _frame(stamp_us: int, word: int, length: int, flags: int, cause: int, data: Iterable[int]) -> str:
    """A frame's record in C."""
    said = ", ".join(map(str, bytes(data).rstrip(b"\0") or b"\0"))
    return f"{{{stamp_us}, {word}U, {length}, {flags}, {cause}, {{{said}}}}}"


def _lines(rows: Iterable[str]) -> str:
    return ",\n".join(f"    {row}" for row in rows)
