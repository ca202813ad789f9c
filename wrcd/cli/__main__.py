"""python -m wrcd.cli."""

import sys

from wrcd.cli.main import main

sys.exit(main())
