"""Keys that an earlier version knew. What they asked for is gone: each is a warning, whatever stands in it."""

from collections.abc import Mapping

from wrcd.config.section import Section

NO_MORE = "each axle's own Adhesion frame is what there is; fusion has no successor in this version"
# By the key's path: what to use instead.
ENDED: Mapping[tuple[str, ...], str] = {
    ("advice",): "use MuAvailable and Confidence of each axle's Adhesion frame",
    ("fusion",): NO_MORE,
    ("axle", "ahead"): NO_MORE,
    ("axle", "detail", "cause", "drop_ahead"): NO_MORE,
}


def take_out(top: Section) -> list[str]:
    """Take the ended keys out of a configuration. Returns a warning for each, with file, line and key."""
    return [
        str(section.pop(key, "is a key of an earlier version: nothing comes of it", hint))
        for (*tables, key), hint in ENDED.items()
        for section in top.tables_at(*tables)
        if key in section
    ]
