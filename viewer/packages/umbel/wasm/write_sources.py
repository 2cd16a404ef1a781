"""Writes sources.json: what the decoder was compiled from, and a digest of that.

scripts/wasm.sh calls it with the folder of its build."""

import hashlib
import json
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[3]
# Public headers are left out: what they declare for the decoder hardly changes.
WATCHED = ("src/asset/", "src/base/", "viewer/")


def sources(build: Path) -> list[str]:
    """What the compiler has read, by its dependency files, and the script that ran it."""
    found = {"scripts/wasm.sh"}
    for listed in build.glob("*.d"):
        words = listed.read_text().replace("\\\n", " ").split()[1:]
        found.update(word for word in words if word.startswith(WATCHED))
    return sorted(found)


def main() -> None:
    names = sources(Path(sys.argv[1]))
    digest = hashlib.sha256()
    for name in names:
        digest.update((ROOT / name).read_bytes())
    known = {"sha256": digest.hexdigest(), "sources": names}
    (HERE / "sources.json").write_text(json.dumps(known, indent=2) + "\n")


main()
