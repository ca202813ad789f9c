"""The pytest plug-in `wrcd_contract`: whether a consumer of Adhesion frames obeys the contract of the page "What a
controller does with a frame". Here is what a bench's own tests and consumers import."""

from wrcd.bus.frame import Frame
from wrcd.contract.consumers import (
    BusSettings,
    Consumer,
    ConsumerError,
    Hearing,
    ObjectConsumer,
    ProcessConsumer,
    Use,
    print_decisions,
)

__all__ = [
    "BusSettings", "Consumer", "ConsumerError", "Frame", "Hearing", "ObjectConsumer", "ProcessConsumer", "Use",
    "print_decisions",
]  # fmt: skip
