"""The suites of `sim-ecu loop` in the order of the report, known to its command line without what plays them; and the
controllers that the tables compare."""

SUITES = ("braking", "traction", "train", "faults", "worlds", "actuators")
BROAD = ("faults", "worlds", "actuators")

THRESHOLDS, CREEP = "thresholds", "creep"
LAWS = (THRESHOLDS, CREEP)
WITH = {law: f"{law} with wrcd" for law in LAWS}
UNPROTECTED, IDEAL = "unprotected", "ideal"
BARE_AND_WITH = tuple(name for law in LAWS for name in (law, WITH[law]))
CONTROLLERS = (*BARE_AND_WITH, IDEAL)
EVERY = (UNPROTECTED, *CONTROLLERS)
