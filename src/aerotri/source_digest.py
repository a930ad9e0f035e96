"""What tells the code of one version from that of another, for files that are kept from run to run."""

from __future__ import annotations

from functools import cache
from hashlib import sha256
from pathlib import Path


@cache
def digest_of_sources(patterns: tuple[str, ...]) -> str:
    """Of all modules of the package whose paths in it match patterns, one after the other, as they are written."""
    package, digest = Path(__file__).parent, sha256()
    for pattern in patterns:
        for path in sorted(package.rglob(pattern)):
            digest.update(path.read_bytes())
    return digest.hexdigest()
