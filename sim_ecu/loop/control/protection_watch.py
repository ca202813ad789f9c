"""What a controller's process tells of its protection: the guard's interventions, and how the reference was proved."""

from sim_ecu.loop.control.guard import APPLIED_S, MAX_WITHOUT_S
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.counted import times


class ProtectionWatch:
    """Looks at a controller in every cycle; it hears nothing itself."""

    ids: tuple[int, ...] = ()

    def __init__(self, controller: SlipController) -> None:
        self._axles = dict(zip(controller.facts.axles, controller.axles, strict=True))
        self._proof = controller.proof
        self._interventions = dict.fromkeys(self._axles, 0)
        self._off = dict.fromkeys(self._axles, False)
        self._freed: int | None = None

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Nothing is heard."""

    def look(self, now_us: int) -> list[str]:
        """The lines of what has changed in this cycle."""
        lines = []
        for n, a in self._axles.items():
            if a.guard.interventions > self._interventions[n]:
                self._interventions[n] = a.guard.interventions
                lines.append(f"axle {n}: guard: no brake for {MAX_WITHOUT_S:g} s, applied for {APPLIED_S:g} s")
            if a.guard.off is not self._off[n]:
                self._off[n] = a.guard.off
                why = "off: its wheel speed never rose without brake" if a.guard.off else "on again"
                lines.append(f"axle {n}: protection {why}")
        if self._proof.freed is not self._freed:
            self._freed = self._proof.freed
            if self._freed is not None:
                lines.append(f"axle {list(self._axles)[self._freed]}: released to prove the reference speed")
            elif self._proof.proved:
                lines.append("reference speed proved")
        return lines

    def summary(self) -> list[str]:
        """Lines for a person: interventions by axle, releases."""
        guard = ", ".join(f"axle {n}: {times(count)}" for n, count in self._interventions.items() if count)
        lost, released = times(self._proof.losses), times(self._proof.releases)
        return [
            f"guard acted      {guard or 'never'}",
            f"reference speed  lost {lost}, axles released {released} to prove it",
        ]
