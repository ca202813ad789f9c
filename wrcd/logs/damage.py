"""What could not be read of a log, and what its recorder reported as lost."""

from dataclasses import dataclass, field
from pathlib import Path

MAX_LINES = 10  # that are named


@dataclass(slots=True)
class Damage:
    """What could not be read. lines holds the first few line numbers, bad counts them all."""

    bad: int = 0
    lines: list[int] = field(default_factory=list)
    after: int = 0  # frames before the first of them
    cut_line: int | None = None  # last line, cut off in the middle
    stopped: str | None = None  # why the rest was not read
    left_out: list[str] = field(default_factory=list)  # what of it no input is in, and could not be read
    remarks: list[str] = field(default_factory=list)  # what its times or frames rest on, and the file does not say
    lost: int = 0  # frames that the recorder says it has not seen
    read: int = 0

    def note(self, line: int | None = None) -> None:
        """Count a damaged line; None for one whose number nobody knows."""
        if not self.bad:
            self.after = self.read
        self.bad += 1
        if line is not None and len(self.lines) < MAX_LINES:
            self.lines.append(line)

    @property
    def whole(self) -> bool:
        """Whether all of the log was read. What its recorder lost is no damage of the file."""
        return not self.bad and self.cut_line is None and self.stopped is None

    def warnings(self, path: Path) -> list[str]:
        """Sentences for a person; empty if the log was whole."""
        out = []
        if self.bad:
            more = ", …" if self.bad > len(self.lines) else ""
            listed = f" (line {', '.join(map(str, self.lines))}{more})" if self.lines else ""
            many = "s" * (self.bad > 1)
            out.append(f"{path}: {self.bad} damaged line{many} left out{listed}, after frame {self.after}")
        if self.cut_line is not None:
            out.append(f"{path}:{self.cut_line}: cut off in mid-line; processed up to there, frame {self.read}")
        if self.stopped is not None:
            out.append(f"{path}: read up to frame {self.read} only: {self.stopped}")
        out += [f"{path}: left out {what}" for what in self.left_out]
        out += [f"{path}: {what}" for what in self.remarks]
        if self.lost:
            out.append(f"{path}: its recorder says that it lost {self.lost} frames")
        return out
