"""Parts of a configuration file."""

AXLE = """
[[axle]]
number = 1
yaw_rate = "YawRate_A1.YawRate"
lateral_acceleration = "LatAccel_A1.LatAccel"
torque = "Torque_A1.Torque"
"""
VEHICLE = '[vehicle]\nspeed = "VehicleSpeed.Speed"\n'
