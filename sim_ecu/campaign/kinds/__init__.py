"""The kinds of job that there are."""

from sim_ecu.campaign.kind import Kind
from sim_ecu.campaign.kinds.drive import DRIVE
from sim_ecu.campaign.kinds.log import KIND as LOG
from sim_ecu.campaign.kinds.play import PLAY
from sim_ecu.campaign.kinds.score import SCORE
from wrcd.errors import InputError
from wrcd.section import suggest

KINDS: tuple[Kind, ...] = (DRIVE, PLAY, SCORE, LOG)


def kind_of(name: str) -> Kind:
    """A kind by its name. Raises InputError for one that is not there."""
    names = [k.name for k in KINDS]
    if name not in names:
        raise InputError(
            f"there is no kind {name!r}", key="kind", hint=suggest(name, names) or f"kinds: {', '.join(names)}"
        )
    return KINDS[names.index(name)]
