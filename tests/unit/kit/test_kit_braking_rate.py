"""The kit's braking rate in C decides as the rig's in Python does, on whole numbers that both take exactly."""

import random
import re
import subprocess
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from sim_ecu.loop.control.braking_rate import RATES, AdvisedRate, RateLimits, needed_m_s2

from tests.support.kit.building import COMPILERS, WARNINGS, build, needs_compiler, run, written

pytestmark = needs_compiler
# Of the limits in C, in their order: name in Python, and the unit.
UNITS = {
    "dry": 10_000, "cautious": 10_000, "least": 10_000, "kept": 100, "falls_to": 100, "holds_s": 1_000_000,
    "stands_s": 1_000_000, "same_m": 1000, "tests": 10_000, "test_s": 1_000_000, "found_s": 1_000_000,
}  # fmt: skip
INFINITE = (1 << 32) - 1
OTHER = replace(RATES, dry=1.1, cautious=0.5, least=0.1, kept=0.7, falls_to=0.8, holds_s=1.0, stands_s=60.0, same_m=5.0)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(written(tmp_path_factory.mktemp("kit")), "rate")


def whole(limits: RateLimits) -> str:
    return " ".join(str(round(getattr(limits, name) * unit)) for name, unit in UNITS.items())


def exactly(limits: RateLimits) -> RateLimits:
    """With fractions in place of floats: no rounding decides."""
    changed: dict[str, Any] = {name: Fraction(str(getattr(limits, name))) for name in UNITS}
    return replace(limits, **changed)


def calls(limits: RateLimits, seed: int, number: int) -> list[tuple[str, float, float, bool]]:
    """A train that coasts, stands, tests, and hears of good and bad rails: each call, what Python says to it and plans
    with then, and whether an advice holds."""
    rng, out, rate = random.Random(seed), list[tuple[str, float, float, bool]](), AdvisedRate(exactly(limits))
    now_us, mm, middle, testing = 0, rng.randrange(-1_000_000, 1_000_000), 100, False
    for _ in range(number):
        now_us += rng.choice((0, 200_000, 200_000, 600_000, 2_000_000, 2_000_001))
        if rng.random() < 0.05:
            now_us += rng.choice((60_000_000, 300_000_000))
        else:
            mm += rng.choice((0, 0, 4_000, 5_000, 5_001, 30_000, 30_001, -1_000))
        if rng.random() < 0.2:
            middle = rng.choice((3 * middle // 5, 100, rng.randrange(251)))
        op = rng.choice(("take", "take", "take", "silent", "tested" if testing else "tests", "needed"))
        op = "init" if rng.random() < 0.01 else op
        a, b, position, said = rng.randrange(0, middle + 1), middle, Fraction(mm, 1000), 0.0
        if op == "init":
            rate, testing = AdvisedRate(exactly(limits)), False
        elif op == "take":
            rate.take(now_us, position, Fraction(a, 100), Fraction(b, 100))  # type: ignore[arg-type]
        elif op == "tests":
            said = testing = rate.tests(now_us, position)  # type: ignore[arg-type]
        elif op == "tested":
            rate.tested(now_us, position)  # type: ignore[arg-type]
            testing = False
        elif op == "needed":
            a, b = rng.choice((0, rng.randrange(60_000), 1_000_000)), rng.choice((-1, 0, 1, rng.randrange(2_000_000)))
            said = 1e4 * needed_m_s2(1e-3 * a, 1e-3 * b)
        planned = 10_000 * rate.rate_m_s2(now_us, position)  # type: ignore[arg-type]
        out.append((f"{op} {now_us} {mm} {a} {b}", said, planned, rate.holds(now_us, mm / 1000)))
    return out


def test_call_of_the_readme_compiles(program: Path) -> None:
    fences = re.findall(r"^```c\n(.*?)^```$", (program.parent / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    declared, call = fences[1].split("\n\n", 1)
    (program.parent / "call.c").write_text(
        f'#include "braking_rate.h"\n#include <stddef.h>\nstatic adhesion_receiver_t receiver;\n{declared}\n'
        "uint64_t now_us(void);\nvoid begin_to_brake(void);\n"
        "void step(adhesion_verdict_t, uint32_t, uint8_t, int64_t, int64_t, int64_t, uint32_t);\n"
        "void step(adhesion_verdict_t verdict, uint32_t id, uint8_t flags, int64_t mark_mm, int64_t position_mm,\n"
        f"          int64_t reaction_mm, uint32_t speed_mm_s)\n{{\n{call}}}\n"
    )
    command = [COMPILERS[0], *WARNINGS, "-fsyntax-only", program.parent / "call.c"]
    subprocess.run([str(word) for word in command], timeout=60, check=True)


@pytest.mark.parametrize("limits", [RATES, OTHER], ids=["default", "other"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_c_says_what_python_says(program: Path, limits: RateLimits, seed: int) -> None:
    asked, seen = calls(limits, seed, 4000), Counter[str]()
    first, *answers = run(program, [whole(limits), *(call for call, *_ in asked)])
    assert first == whole(RATES)
    named = {limits.dry: "dry", limits.cautious: "cautious", limits.least: "least"}
    for (call, said, planned, holds), answer in zip(asked, answers, strict=True):
        c_said, c_planned = map(int, answer.split())
        # needed is rounded down, and of 32 bits; all else is whole
        assert c_said == INFINITE if said > INFINITE else -1e-12 * said <= said - c_said < 1.0, call
        assert c_planned == planned, call
        seen.update((call.split()[0], "holds" if holds else "silent", named.get(c_planned / 10_000, "between")))
        seen["infinite"] += c_said == INFINITE
        seen["begins"] += call.startswith("tests ") and c_said == 1
    for what in ("begins", "tests", "tested", "infinite", "needed", "holds", "silent", *named.values(), "between"):
        assert seen[what] > 10, what
