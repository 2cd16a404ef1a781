"""SVG pictures for the documentation."""

from __future__ import annotations

from collections.abc import Sequence

Point = tuple[float, float]

# Distinct to the colour-blind as well (Okabe and Ito, "Color universal design", 2008).
COLORS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999")
INK, GREY, PALE = "#333333", "#888888", "#dddddd"
WRONG = "#d55e00"


class Figure:
    """An SVG picture on a white ground, readable on dark pages too."""

    def __init__(self, width: float, height: float, title: str) -> None:
        self.width, self.height, self.title = width, height, title
        self.parts: list[str] = []

    def _add(self, name: str, **given: object) -> None:
        words = " ".join(
            f'{key.rstrip("_").replace("_", "-")}="{text_of(value)}"'
            for key, value in given.items()
        )
        self.parts.append(f"<{name} {words}/>")

    def line(
        self, a: Point, b: Point, color: str = INK, width: float = 1.5, dash: str = ""
    ) -> None:
        extra = {"stroke_dasharray": dash} if dash else {}
        self._add(
            "line", x1=a[0], y1=a[1], x2=b[0], y2=b[1], stroke=color, stroke_width=width, **extra
        )

    def rect(self, at: Point, size: Point, fill: str, stroke: str = "none") -> None:
        self._add("rect", x=at[0], y=at[1], width=size[0], height=size[1], fill=fill, stroke=stroke)

    def circle(self, at: Point, radius: float, fill: str, stroke: str = INK) -> None:
        self._add("circle", cx=at[0], cy=at[1], r=radius, fill=fill, stroke=stroke)

    def polygon(self, points: Sequence[Point], fill: str, stroke: str = "none") -> None:
        flat = " ".join(f"{text_of(x)},{text_of(y)}" for x, y in points)
        self._add("polygon", points=flat, fill=fill, stroke=stroke, stroke_linejoin="round")

    def path(self, d: str, color: str = INK, width: float = 1.5, dash: str = "") -> None:
        extra = {"stroke_dasharray": dash} if dash else {}
        self._add("path", d=d, fill="none", stroke=color, stroke_width=width, **extra)

    def text(
        self, at: Point, words: str, size: float = 13, color: str = INK, anchor: str = "start"
    ) -> None:
        words = words.replace("&", "&amp;").replace("<", "&lt;")
        self.parts.append(
            f'<text x="{text_of(at[0])}" y="{text_of(at[1])}" font-size="{text_of(size)}" '
            f'fill="{color}" text-anchor="{anchor}">{words}</text>'
        )

    def cross(self, at: Point, size: float = 6, color: str = WRONG) -> None:
        x, y = at
        self.line((x - size, y - size), (x + size, y + size), color, 2.5)
        self.line((x - size, y + size), (x + size, y - size), color, 2.5)

    def svg(self) -> str:
        width, height = text_of(self.width), text_of(self.height)
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'width="{width}" height="{height}" font-family="sans-serif" role="img">'
        )
        ground = '<rect width="100%" height="100%" fill="white"/>'
        return "\n".join([head, f"<title>{self.title}</title>", ground, *self.parts, "</svg>\n"])


def text_of(value: object) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)
