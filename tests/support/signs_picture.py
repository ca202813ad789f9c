"""Draws docs/signs-and-axes.png: python -m tests.support.signs_picture [FILE]."""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyArrowPatch, Rectangle

PICTURE = Path(__file__).parents[2] / "docs" / "signs-and-axes.png"
AXIS, YAW, ACCEL, TORQUE, FORCE, STEEL = "black", "#0072B2", "#D55E00", "#009E73", "#7B3294", "0.45"
GAUGE = 0.75  # half of it
# What is drawn, by case: the sign of the yaw rate and of the lateral acceleration on a curve, and of torque, force at
# the wheel's rim and change of speed. A test compares them with the rig's physics.
CURVES = {"left-hand curve": (1, 1), "right-hand curve": (-1, -1)}
TORQUES = {"traction": (1, 1, 1), "braking": (-1, -1, -1)}


def draw(file: Path) -> None:
    """Top view, curves, side view."""
    with mpl.rc_context({"font.size": 10, "svg.hashsalt": "signs"}):
        figure = Figure(figsize=(12.0, 7.4))
        _top(figure.add_axes((0.01, 0.42, 0.47, 0.53)))
        for place, (name, signs) in enumerate(CURVES.items()):
            _curve(figure.add_axes((0.50 + 0.25 * place, 0.42, 0.24, 0.53)), name, *signs)
        for place, (name, signs3) in enumerate(TORQUES.items()):
            _wheel(figure.add_axes((0.01 + 0.49 * place, 0.01, 0.48, 0.38)), name, *signs3)
        figure.savefig(file, dpi=110, metadata={"Software": None})


def _axes(ax: Axes, title: str, width: float, height: float, y: float = 0.0) -> None:
    ax.set(xlim=(-width, width), ylim=(y - height, y + height), aspect="equal")
    ax.set_axis_off()
    ax.set_title(title, loc="left", fontsize=11, fontweight="bold")


def _arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
    ax.add_patch(
        FancyArrowPatch(
            start, end, color=colour, arrowstyle="-|>", mutation_scale=16, lw=2.2, shrinkA=0, shrinkB=0, zorder=5
        )
    )


def _turn(ax: Axes, centre: tuple[float, float], radius: float, from_deg: float, to_deg: float, colour: str) -> None:
    """An arc with its head at to_deg; counter-clockwise if that is the larger angle."""
    low, high = sorted((from_deg, to_deg))
    ax.add_patch(Arc(centre, 2 * radius, 2 * radius, theta1=low, theta2=high, color=colour, lw=2.2, zorder=5))
    end, before = (np.deg2rad(to_deg + shift) for shift in (0.0, -8.0 if to_deg > from_deg else 8.0))
    head, tail = ((centre[0] + radius * np.cos(a), centre[1] + radius * np.sin(a)) for a in (end, before))
    _arrow(ax, tail, head, colour)


def _wheelset(ax: Axes, x: float, y: float, degrees: float, size: float = 1.0) -> None:
    """From above, its axle square to the rails at 0 degrees."""
    turn = mpl.transforms.Affine2D().scale(size).rotate_deg(degrees).translate(x, y) + ax.transData
    ax.add_patch(Rectangle((-0.05, -1.05), 0.1, 2.1, color=STEEL, transform=turn, zorder=3))
    for side in (-GAUGE, GAUGE):
        ax.add_patch(Rectangle((-0.42, side - 0.07), 0.84, 0.14, color="0.3", transform=turn, zorder=4))


def _top(ax: Axes) -> None:
    _axes(ax, "seen from above", 2.55, 1.72)
    for side in (-GAUGE, GAUGE):
        ax.plot([-2.5, 2.5], [side, side], color="0.75", lw=4, solid_capstyle="butt")
    ax.plot([-2.5, 2.5], [0, 0], color="0.75", lw=1, ls=(0, (8, 4)))
    ax.text(-2.5, 0.06, "track's centre line", color="0.5", fontsize=9)
    _wheelset(ax, -0.4, 0.0, 0.0)
    _arrow(ax, (-0.4, 0), (2.1, 0), AXIS)
    ax.text(1.02, -0.12, "x: direction of travel", va="top")
    _arrow(ax, (-0.4, 0), (-0.4, 1.45), AXIS)
    ax.text(-0.33, 1.40, "y: to the left", va="center")
    _turn(ax, (-0.4, 0.0), 0.52, -50, 65, YAW)
    ax.text(0.20, 0.36, "yaw, yaw rate: counter-clockwise", color=YAW, va="center")
    ax.add_patch(Rectangle((-1.03, 0.93), 0.26, 0.2, color=ACCEL, zorder=4))
    ax.plot([-0.77, -0.4], [1.03, 1.03], color=ACCEL, lw=1)
    _arrow(ax, (-0.9, 1.13), (-0.9, 1.62), ACCEL)
    ax.text(-1.10, 1.38, "lateral acceleration\nto the left", color=ACCEL, ha="right", va="center")
    ax.text(-1.10, 1.03, "axle box", color=ACCEL, ha="right", va="center", fontsize=9)
    ax.text(-2.5, 0.60, "left rail", color="0.5", fontsize=9, va="top")
    ax.text(-2.5, -0.82, "right rail", color="0.5", fontsize=9, va="top")
    ax.text(
        -2.5,
        -1.25,
        "A gyro whose axis points down, an accelerometer whose\naxis points to the right: sign = -1.",
        va="top",
    )


def _curve(ax: Axes, title: str, yaw: int, accel: int) -> None:
    """From above, with the travel upwards: the rail bends to the side to which the train turns."""
    _axes(ax, title, 1.3, 1.72)
    centre, radius, angle = (-2.6 * yaw, -1.2), 2.6, 0.55
    along = np.linspace(-0.12, 0.95, 60)
    for offset, width, style in ((0.28, 4.0, "-"), (-0.28, 4.0, "-"), (0.0, 1.0, (0, (8, 4)))):
        r = radius + offset
        ax.plot(centre[0] + yaw * r * np.cos(along), centre[1] + r * np.sin(along), color="0.75", lw=width, ls=style)
    x, y = centre[0] + yaw * radius * np.cos(angle), centre[1] + radius * np.sin(angle)
    _wheelset(ax, x, y, 90 + yaw * np.rad2deg(angle), 0.36)
    ahead = np.array([-yaw * np.sin(angle), np.cos(angle)])
    left = np.array([-ahead[1], ahead[0]])
    _arrow(ax, (x, y), tuple(np.array([x, y]) + 0.75 * ahead), AXIS)
    _arrow(ax, (x, y), tuple(np.array([x, y]) + 0.85 * accel * left), ACCEL)
    heading = float(np.rad2deg(np.arctan2(ahead[1], ahead[0])))
    _turn(ax, (x, y), 0.62, heading - 12 * yaw, heading + 52 * yaw, YAW)
    sign = {1: "> 0", -1: "< 0"}
    ax.text(-1.28, 1.52, f"yaw rate {sign[yaw]}", color=YAW)
    ax.text(-1.28, 1.29, f"lateral acceleration {sign[accel]}", color=ACCEL)


def _wheel(ax: Axes, title: str, torque: int, force: int, faster: int) -> None:
    """From the right-hand side, with the travel to the right: a wheel that rolls turns clockwise."""
    _axes(ax, f"{title}, seen from the right", 2.55, 1.03, 0.05)
    ax.plot([-2.5, 2.5], [-0.72, -0.72], color="0.75", lw=4)
    ax.add_patch(Circle((-0.9, 0), 0.7, fill=False, color="0.3", lw=3))
    ax.add_patch(Circle((-0.9, 0), 0.06, color=STEEL))
    ax.text(-0.9, 0.14, "torque\n" + ("> 0" if torque > 0 else "< 0"), color=TORQUE, ha="center", va="bottom")
    _turn(ax, (-0.9, 0.0), 0.52, 205 if torque > 0 else -25, -25 if torque > 0 else 205, TORQUE)
    _arrow(ax, (-0.9, -0.70), (-0.9 + 0.95 * force, -0.70), FORCE)
    ax.text(-0.9 + 0.5 * force, -0.80, "force on the wheel", color=FORCE, ha="center", va="top")
    _arrow(ax, (0.15, 0.62), (1.05, 0.62), AXIS)
    ax.text(1.15, 0.62, "x: travel", va="center")
    ax.text(0.15, 0.16, f"the train becomes {'faster' if faster > 0 else 'slower'}", va="center")
    turns = "drives the wheel on" if torque > 0 else "holds the wheel back"
    ax.text(0.15, -0.24, f"a torque that {turns}\nis {'positive' if torque > 0 else 'negative'}", va="center")


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
