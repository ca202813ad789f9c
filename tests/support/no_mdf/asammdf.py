"""On PYTHONPATH: a program finds no asammdf, as where MF4 is not asked for. python-can loads it for half a second."""

raise ImportError("asammdf is left out of the programs that tests start; see tests/conftest.py")
