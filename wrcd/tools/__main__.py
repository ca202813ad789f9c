"""python -m wrcd.tools."""

import sys

from wrcd.tools.cli import main

sys.exit(main())
