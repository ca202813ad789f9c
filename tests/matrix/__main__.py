"""python -m tests.matrix: the whole table, a row a fault, in minutes; exit 1 if a row failed."""

import sys

from tests.matrix.matrix import HEAD, line, verdicts

failed = False
print(HEAD)
for row, verdict in verdicts():
    print(line(row, verdict), flush=True)
    failed |= bool(verdict.wrong)
sys.exit(failed)
