"""Which exporters a replay needs, whether their libraries are there, and what a file says of itself."""

import importlib
from pathlib import Path
from typing import TYPE_CHECKING

from wrcd import __version__
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.tools.export.records import About

if TYPE_CHECKING:
    from wrcd.tools.export.gather import Gather
    from wrcd.tools.export.records import Exporter
    from wrcd.tools.outputs import Outputs

LIBRARIES = {"mf4": "asammdf", "mcap": "mcap"}  # by extra


def gather(outputs: "Outputs", config: Config) -> "Gather | None":
    """What feeds the files asked for, None if none is. Raises InputError for one that cannot be made."""
    exporters: list[Exporter] = []
    if outputs.mf4 is not None:
        _check("mf4", outputs.mf4)
        from wrcd.tools.export.mf4_file import Mf4File

        exporters.append(Mf4File(outputs.mf4))
    if outputs.mcap is not None:
        _check("mcap", outputs.mcap)
        from wrcd.tools.export.mcap_file import McapFile

        exporters.append(McapFile(outputs.mcap))
    if not exporters:
        return None
    from wrcd.tools.export.gather import Gather

    return Gather(config, exporters)


def _check(extra: str, path: Path) -> None:
    """Raises InputError without the library, or for another suffix."""
    try:
        importlib.import_module(LIBRARIES[extra])
    except ModuleNotFoundError:
        raise InputError(f"needs the extra {extra}", key=f"--{extra}", hint=f"pip install 'wrcd[{extra}]'") from None
    if path.suffix.lower() != f".{extra}":
        raise InputError(
            f"is no name of such a file: its readers go by the suffix .{extra}", file=path, key=f"--{extra}",
            hint=f"{path.stem}.{extra}",
        )  # fmt: skip


def about(log: Path, config: Config, first_us: int) -> About:
    """Whose values a file holds. first_us: the time of the log's first frame."""
    design = config.design
    facts = {
        "program": f"wrcd {__version__}",
        "design": f"{design.name} {design.checksum}",
        "log": log.name,
        "configuration": Path(config.file).name,
    }
    return About(first_us, facts)
