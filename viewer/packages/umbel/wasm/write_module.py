"""Writes ../src/decode/wasm_module.ts: the compiled decoder, and a digest of its sources.

scripts/wasm.sh calls it with the folder of its build."""

import base64
import hashlib
import sys
from pathlib import Path

ROOT = Path(__file__).parents[4]
MODULE = ROOT / "viewer/packages/umbel/src/decode/wasm_module.ts"
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
    build = Path(sys.argv[1])
    names = sources(build)
    digest = hashlib.sha256()
    for name in names:
        digest.update((ROOT / name).read_bytes())
    listed = "".join(f'  "{name}",\n' for name in names)
    code = base64.b64encode((build / "decoder.wasm").read_bytes()).decode()
    MODULE.write_text(
        "// Made by scripts/wasm.sh: do not edit. The library's decoder, as WebAssembly.\n\n"
        "/** What it was compiled from. */\n"
        f"export const WASM_SOURCES = [\n{listed}];\n\n"
        "/** The SHA-256 of these files, one after the other. */\n"
        f'export const WASM_DIGEST = "{digest.hexdigest()}";\n\n'
        "/** The module, in base64. */\n"
        f'export const WASM_MODULE =\n  "{code}";\n'
    )
    print(f"wasm: {len(code)} characters in {MODULE.relative_to(ROOT)}")


main()
