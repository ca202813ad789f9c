"""A configuration of many forms, and what is changed in it."""

from pathlib import Path

DBC = Path(__file__).parents[2] / "data" / "dbc" / "mistakes.dbc"
BASE = """[dbc]
file = "mistakes.dbc"
[wheelset]
name = "multiple-unit"
[vehicle]
speed = "Drive.V"
[[axle]]
number = 1
yaw_rate = "Imu1.Gyro"
lateral_acceleration = "Imu1.Acc"
torque = "Tcu.Torque"
"""
SECOND = """
[[axle]]
number = 2
yaw_rate = "Imu2.Gyro"
lateral_acceleration = { signal = "Imu2.Acc", unit = "g" }
torque = "Tcu.Torque"
"""
SPEED, YAW, ACC, TORQUE = (
    'speed = "Drive.V"', 'yaw_rate = "Imu1.Gyro"', 'lateral_acceleration = "Imu1.Acc"', 'torque = "Tcu.Torque"',
)  # fmt: skip
Edit = tuple[str, str]


def of_yaw_rate(keys: str) -> Edit:
    return YAW, f'yaw_rate = {{ signal = "Imu1.Gyro", {keys} }}'


def of_torque(keys: str) -> Edit:
    return TORQUE, f"torque = {{ {keys} }}"


def after(lines: str) -> Edit:
    return TORQUE, f"{TORQUE}\n{lines}"


def of_adhesion(keys: str) -> Edit:
    return after(f"adhesion = {{ {keys} }}")


def written(folder: Path, edits: list[Edit]) -> Path:
    text = BASE
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "train.toml"
    path.write_text(text)
    return path
