"""The rail cleaned by slip: an axle meets the energy that those ahead of it have put into a place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.physics.treated_rail import FloatArray, Treatment


@dataclass(frozen=True, slots=True)
class Cleaning(Treatment):
    """How much energy (kJ/m, both wheels) cleans a contaminated rail, and how clean it gets: this project's choice."""

    energy_kJ_m: float = 10.0
    clean_mu_0: float = 0.30

    @property
    def scale(self) -> float:
        """Energy per metre that goes 63 % of the way."""
        return self.energy_kJ_m

    @property
    def best_mu_0(self) -> float:
        """mu_0 of the clean rail."""
        return self.clean_mu_0

    def met(self, positions_m: Sequence[float]) -> FloatArray:
        """All that those ahead have put in; an axle's own energy is for the others."""
        p = np.array(positions_m)
        return (p[None, :] > p[:, None]).astype(np.float64)
