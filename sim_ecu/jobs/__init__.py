"""Many jobs: pure functions of plain inputs on Dask, each in a process that may die or hang alone."""
