"""Progress of one long piece of work after another."""

from wrcd.tools.progress import Progress


class Pieces:
    """What a Progress shows, with the time left of the piece that is going on: the next one begins where one ends."""

    def __init__(self) -> None:
        self._progress, self._share = Progress(steps=True), 0.0

    def at(self, what: str, share: float) -> None:
        """What is going on, and the share of this piece that is done."""
        if share < self._share:
            self._progress = Progress(steps=True)
        self._share = share
        self._progress.at(what, share)
        if share >= 1.0:
            self._progress, self._share = Progress(steps=True), 0.0

    def end(self) -> None:
        """Leave the line."""
        self._progress.end()
