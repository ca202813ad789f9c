"""Which estimator runs: the compiled one where its library is there, else the reference in numpy."""

from wrcd.estimator.design import Design
from wrcd.estimator.estimator import Estimator
from wrcd.estimator.native_estimator import CompiledEstimator, CompiledHealth
from wrcd.estimator.trust.health import PairHealth
from wrcd.native import library

Engine = Estimator | CompiledEstimator
EngineHealth = PairHealth | CompiledHealth


def make_estimator(design: Design, axles: int) -> Engine:
    """The fastest that there is for a design and so many axles."""
    c = library()
    if c is not None:
        try:
            return CompiledEstimator(c, design, axles)
        except ValueError:  # larger than the library's limits
            pass
    return Estimator(design, axles)
