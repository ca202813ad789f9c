"""python -m tests.support.reader_on_pair BUS: the monitor's reader of a bus, on the pair's end that $END tells."""

import os
import sys

from tests.support.can_socket import use_pair
from wrcd.monitor.bus_reader import main

use_pair(int(os.environ["END"]))
sys.exit(main())
