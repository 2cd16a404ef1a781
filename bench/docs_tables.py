"""Tables and charts of a run that documents show: what stands in a document between
`<!-- NAME: from SOURCE -->` and `<!-- end -->` is replaced."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Markdown; all columns but the first are numbers."""
    lines = [head, ["---", *["--:"] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def fill(document: Path, texts: Mapping[str, str], source: str = "a run") -> None:
    """Puts the texts where they belong; all places of this source must be known and filled."""
    content = document.read_text()
    places = re.findall(rf"<!-- (.+): from {source} -->", content)
    if sorted(places) != sorted(texts):
        raise SystemExit(f"{document.name} has places for {places}, but there are {list(texts)}")
    for name, text in texts.items():
        pattern = rf"(<!-- {re.escape(name)}: from {source} -->\n).*?(<!-- end -->)"
        content = re.sub(
            pattern, lambda found, text=text: f"{found[1]}{text}\n{found[2]}", content, flags=re.S
        )
    document.write_text(content)


def save_chart(figure: Any, file: Path) -> None:
    """As a PNG with a palette."""
    figure.savefig(file, format="png", dpi=100)
    shrink(file, file)


def shrink(chart: Path, file: Path) -> None:
    """With a palette."""
    from PIL import Image

    with Image.open(chart) as picture:
        small = picture.convert("RGB").quantize(256)
    small.save(file, optimize=True)
    print(f"wrote {file}")
