"""The bounds by which lint judges a sensor, against what they are said to come from."""

from collections import defaultdict

import pytest

from sim_ecu.play.player import Player
from sim_ecu.play.scenario import load_scenario
from tests.support.signals import decode
from wrcd.bus.units import Quantity
from wrcd.tools.lint.inputs import REACHED
