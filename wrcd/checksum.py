"""The checksum that a JSON document carries in itself."""

import hashlib
import json
from typing import Any


def checksum(document: dict[str, Any]) -> str:
    """SHA-256 (hex) over the document without its own checksum, in one canonical spelling."""
    body = {k: v for k, v in document.items() if k != "checksum"}
    return hashlib.sha256(json.dumps(body, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
