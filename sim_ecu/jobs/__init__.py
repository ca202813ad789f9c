"""Many jobs: pure functions of plain inputs, in processes here or elsewhere; what is done is kept."""
