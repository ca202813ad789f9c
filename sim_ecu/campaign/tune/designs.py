"""Designs of the candidates that are played, as files: made once, found again by the next go."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim_ecu.campaign.job import Job, code
from sim_ecu.design.brief import written
from sim_ecu.design.cases import Progress
from sim_ecu.design.make import Brief, bank, fitted, write
from sim_ecu.design.recordings import Recording, record
from wrcd.errors import InputError

# Conditions of a design that is played to be compared: a quarter of the shipped one's. The one that is chosen is made
# anew from all.
DRAFT_SPEEDS, DRAFT_PER_SPEED = 16, 150


def draft(brief: Brief) -> Brief:
    """The brief with fewer conditions."""
    plan = brief.plan
    speeds, per_speed = min(plan.speeds, DRAFT_SPEEDS), min(plan.per_speed, DRAFT_PER_SPEED)
    return replace(brief, plan=replace(plan, speeds=speeds, per_speed=per_speed))


def save(file: Path, put: Callable[[Path], object]) -> None:
    """Put a file beside it, then in its place: whole or not at all. Raises InputError where it cannot be written."""
    partly = file.with_suffix(".part")
    try:
        put(partly)
        os.replace(partly, file)
    except OSError as e:
        raise InputError(
            f"cannot be written: {e.strerror}", file=file, hint="check the folder, its room and your rights"
        ) from None


class Designs:
    """Makes designs of one plan's conditions, which are simulated when the first one is missing.

    Raises InputError where the folder or a file cannot be written.
    """

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._folder, self._progress = folder, progress
        self._recordings: tuple[Brief, list[Recording]] | None = None
        try:
            folder.mkdir(exist_ok=True)
        except OSError as e:
            raise InputError(f"cannot be made: {e.strerror}", file=folder, hint="name another folder") from None

    def of(self, brief: Brief) -> Path | None:
        """The file; None where there is no such design: a filter that has no steady gain, or is not stable."""
        file = self._folder / f"{Job('design', {'brief': written(brief)}).key(code())}.json"
        if file.exists():
            return file
        try:
            document = fitted(brief, bank(brief), self._recorded(brief), self._progress)
        except (np.linalg.LinAlgError, InputError):
            return None
        save(file, lambda partly: write(document, partly))
        return file

    def _recorded(self, brief: Brief) -> list[Recording]:
        if self._recordings is None or self._recordings[0].plan != brief.plan:
            self._recordings = brief, record(brief.wheelset, brief.plan, brief.tick_s, self._progress)
        return self._recordings[1]
