"""The loop closed: rig, controllers on the bus, lockstep, figures; here the names of suites and controllers."""

SUITES = ("braking", "traction", "train", "faults", "worlds", "actuators")
BROAD = ("faults", "worlds", "actuators")

THRESHOLDS, CREEP = "thresholds", "creep"
LAWS = (THRESHOLDS, CREEP)
WITH = {law: f"{law} with wrcd" for law in LAWS}
UNPROTECTED, IDEAL = "unprotected", "ideal"
BARE_AND_WITH = tuple(name for law in LAWS for name in (law, WITH[law]))
CONTROLLERS = (*BARE_AND_WITH, IDEAL)
EVERY = (UNPROTECTED, *CONTROLLERS)
