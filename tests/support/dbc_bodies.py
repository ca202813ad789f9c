"""Databases made of a few lines."""

from pathlib import Path

from wrcd.bus.dbc import Database, parse_dbc

_HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: B\n'


def database(body: str) -> Database:
    """Of messages, value tables and so on; the lines before them are usual."""
    return parse_dbc(_HEAD + body, Path("lines.dbc"))
