"""[advice]: the message of the train's deceleration, and from which deceleration each of its categories holds."""

from itertools import pairwise

from wrcd.bus.dbc import Database
from wrcd.config import declared
from wrcd.config.keys import names
from wrcd.config.outputs import output
from wrcd.config.section import Section
from wrcd.core.configuration import AdviceConfig

ADVICE_MESSAGE = "AdhesionAdvice"


def read_advice(top: Section, database: Database | None, tick_ms: float) -> AdviceConfig | None:
    """The train's advice; None: there is no [advice], or it has a mistake, which is collected."""
    if "advice" not in top:
        return None
    section = top.section("advice")
    found = output(section, "advice", database, ADVICE_MESSAGE, tick_ms, declared.ADVICE_MESSAGE.name)
    limits = tuple(key.value(section) for key in declared.CATEGORY_KEYS)
    for (better, high), (worse, low) in pairwise(zip(declared.CATEGORY_KEYS, limits, strict=True)):
        if low >= high:
            reason = f"is {low:g}, not less than {better.name}, {high:g}"
            section.refuse(reason, worse.name, "a category holds from a lower deceleration than the better one")
    section.done(names(declared.TABLES["advice"]))
    return None if found is None else AdviceConfig(found, limits)
