"""Databases made of a few lines."""

from cantools import database as cantools_database

from wrcd.bus.dbc import Database

_HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: B\n'


def database(body: str) -> Database:
    """Of messages, value tables and so on; the lines before them are usual."""
    found = cantools_database.load_string(_HEAD + body, "dbc", strict=True)
    assert isinstance(found, cantools_database.Database)
    made = Database(found.messages, found.nodes, found.buses, found.version, found.dbc)
    made.unsound, made.warnings = {}, ()
    return made
