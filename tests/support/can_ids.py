"""CAN ids of the packaged DBC files, by message; those that every axle has, by axle."""

from sim_ecu.play.encoder import databases

AXLES = range(1, 5)  # of the default configuration
_PRODUCTION, _TRUTH = databases()
_ID = {m.name: m.frame_id for database in (_PRODUCTION, _TRUTH) for m in database.messages}


def id_of(message: str) -> int:
    """By the message's name."""
    return _ID[message]


def _of_axles(name: str) -> dict[int, int]:
    return {axle: _ID[f"{name}_A{axle}"] for axle in AXLES}


ADHESION = _of_axles("Adhesion")
ADHESION_DETAIL = _of_axles("AdhesionDetail")
INPUT_HEALTH = _of_axles("InputHealth")
YAW_RATE = _of_axles("YawRate")
LAT_ACCEL = _of_axles("LatAccel")
TORQUE = _of_axles("Torque")
SIM_TRUTH = _of_axles("SimTruth")

ADHESION_A1 = ADHESION[1]
ADHESION_DETAIL_A1 = ADHESION_DETAIL[1]
YAW_RATE_A1, YAW_RATE_A2 = YAW_RATE[1], YAW_RATE[2]
LAT_ACCEL_A1 = LAT_ACCEL[1]
TORQUE_A1, TORQUE_A2 = TORQUE[1], TORQUE[2]
SIM_TRUTH_A1 = SIM_TRUTH[1]
VEHICLE_SPEED = _ID["VehicleSpeed"]
WRCD_STATUS, WRCD_REJECTS, WRCD_LINK = _ID["WrcdStatus"], _ID["WrcdRejects"], _ID["WrcdLink"]

INPUTS = {VEHICLE_SPEED, *YAW_RATE.values(), *LAT_ACCEL.values(), *TORQUE.values()}
ESTIMATES = {*ADHESION.values(), *ADHESION_DETAIL.values(), *INPUT_HEALTH.values()}
SENDABLE = {m.frame_id for m in _PRODUCTION.messages if "WRCD" in m.senders}  # for any number of axles
UNMAPPED, EXTENDED = 0x7FF, 0x18FF0001  # of no message; EXTENDED has 29 bits
EXTENDED_KEY = 1 << 31 | EXTENDED  # as Frame.key
