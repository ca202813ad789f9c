"""What has been found out so far, in a file: whatever ends a search, the next one with the same question goes on."""

import json
from pathlib import Path
from typing import Any

from sim_ecu.campaign.job import Job, code
from wrcd.errors import InputError


class Journal:
    """Answers by the key of their question, a line each, written as they come. A line that a kill cut off is left out.

    Raises InputError where the file cannot be written.
    """

    def __init__(self, file: Path) -> None:
        self._answers: dict[str, Any] = {}
        whole = b""
        try:
            if file.exists():
                text = file.read_bytes()
                whole = text[: text.rfind(b"\n") + 1]
                self._answers = dict(map(_entry, whole.splitlines()))
            file.write_bytes(whole)
            self._file = file.open("a", encoding="utf-8")
        except (OSError, ValueError, KeyError) as e:
            raise InputError(
                f"cannot be used: {e}", file=file, hint="name another folder, or delete the file"
            ) from None

    def __len__(self) -> int:
        return len(self._answers)

    def answer(self, question: Job) -> Any:
        """What is known, or None."""
        return self._answers.get(question.key(code()))

    def add(self, question: Job, answer: Any) -> None:
        """Keep an answer: numbers, texts, lists and tables of them."""
        key = question.key(code())
        self._answers[key] = answer
        self._file.write(json.dumps({"key": key, "answer": answer}) + "\n")
        self._file.flush()

    def close(self) -> None:
        """Nothing more is added."""
        self._file.close()


def _entry(line: bytes) -> tuple[str, Any]:
    entry = json.loads(line)
    return entry["key"], entry["answer"]
