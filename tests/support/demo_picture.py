"""Makes docs/leaf-patch.png: python -m tests.support.demo_picture [FILE]. What the demo draws of its own run."""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from sim_ecu.play import demo

PICTURE = Path(__file__).parents[2] / "docs" / "leaf-patch.png"
SCENARIO = "leaf-patch"


def picture(folder: Path) -> bytes:
    """Run the demo on python-can's virtual bus, whose time waits for a busy computer, as PNG."""
    if demo.run("virtual", "picture", SCENARIO, folder):
        raise RuntimeError("the demo saw no valid estimate")
    return (folder / f"{SCENARIO}.png").read_bytes()


def write(make: Callable[[Path], bytes], output: Path) -> None:
    """Make a picture in a temporary folder; write it to the file that the command line names, or to output."""
    with tempfile.TemporaryDirectory() as made:
        data = make(Path(made))
    output = Path(sys.argv[1]) if len(sys.argv) > 1 else output
    output.write_bytes(data)
    print(f"{output}: {len(data)} bytes")


if __name__ == "__main__":
    write(picture, PICTURE)
