"""What people type that needs more than one room: sim-ecu design, sim-ecu score."""
