"""The rail cleaned by slip: what an axle has put into a place of it, the next one finds there."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Cleaning:
    """How much energy cleans a contaminated rail, and how clean it gets. Both are this project's own choice.

    ln mu_0 of a place goes to ln clean_mu_0 as 1 - exp(-E / energy_kJ_m), E being the energy per metre (kJ/m) that the
    axles before have put in with both wheels. A rail that is no worse than the clean one stays as it is.
    """

    energy_kJ_m: float = 10.0
    clean_mu_0: float = 0.30
