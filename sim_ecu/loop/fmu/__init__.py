"""The rig as an FMU: FMI 2.0 co-simulation, made and loaded with PythonFMU (extra fmi)."""
