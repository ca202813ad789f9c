"""python -m tests.matrix: the whole table, a row a fault, in minutes; exit 1 if a row failed."""

import sys

from tests.matrix.matrix import lines

failed = False
for line in lines():
    print(line, flush=True)
    failed |= "| NO" in line
sys.exit(failed)
