"""What has been found out so far, in a file: whatever ends a search, the next one with the same question goes on."""

import contextlib
import fcntl
import json
import os
from pathlib import Path
from typing import Any

from sim_ecu.campaign.job import Job, code
from wrcd.errors import InputError


class Journal:
    """Answers by the key of their question, a line each, written as they come. A line that a kill cut off is left out.
    It belongs to one process at a time.

    Raises InputError where the file cannot be used, or another process is at work with it.
    """

    def __init__(self, file: Path) -> None:
        self._path = file
        self._answers: dict[str, Any] = {}
        try:
            self._file = file.open("a", encoding="utf-8")
        except OSError as e:
            raise _unusable(file, e.strerror) from None
        try:
            self._take()
        except BaseException:
            self._file.close()
            raise

    def _take(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(
                "another search is at work with it", file=self._path,
                hint="wait for its end, or name another folder",
            ) from None  # fmt: skip
        try:
            text = self._path.read_bytes()
            whole = text[: text.rfind(b"\n") + 1]
            self._answers = dict(map(_entry, whole.splitlines()))
            if len(whole) < len(text):
                os.truncate(self._path, len(whole))
        except (OSError, ValueError, KeyError, TypeError) as e:
            raise _unusable(self._path, e) from None

    def __len__(self) -> int:
        return len(self._answers)

    def answer(self, question: Job) -> Any:
        """What is known, or None."""
        return self._answers.get(question.key(code()))

    def add(self, question: Job, answer: Any) -> None:
        """Keep an answer: numbers, texts, lists and tables of them. Raises InputError where it cannot be written."""
        key = question.key(code())
        self._answers[key] = answer
        try:
            self._file.write(json.dumps({"key": key, "answer": answer}) + "\n")
            self._file.flush()
        except OSError as e:
            raise InputError(
                f"cannot be written: {e.strerror}",
                file=self._path,
                hint="make room; the same command goes on from there",
            ) from None

    def close(self) -> None:
        """Nothing more is added."""
        with contextlib.suppress(OSError):  # what a full disk did not take is said already, and is asked again
            self._file.close()


def _unusable(file: Path, why: object) -> InputError:
    return InputError(f"cannot be used: {why}", file=file, hint="name another folder, or delete the file")


def _entry(line: bytes) -> tuple[str, Any]:
    entry = json.loads(line)
    return entry["key"], entry["answer"]
