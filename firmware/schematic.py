"""Symbols of a wiring diagram, as SVG that knows where its labels are. Lengths are in pixels."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.sax.saxutils import escape

SIZE = 13  # of text
ADVANCE = 0.6  # of a character in a monospaced font, in its size
SIGNAL, POWER, GROUND, SAFETY, INK = "#1f5fa8", "#b3261e", "#3c4043", "#b06000", "#202124"


@dataclass(frozen=True)
class Label:
    """A text and the box it takes."""

    text: str
    left: float
    top: float
    width: float
    height: float = SIZE

    def overlaps(self, other: Label) -> bool:
        across = self.left < other.left + other.width and other.left < self.left + self.width
        return across and self.top < other.top + other.height and other.top < self.top + self.height


@dataclass
class Drawing:
    """SVG elements, and where its labels are; lengths and places are in [px], y points down."""

    width: int
    height: int
    elements: list[str] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)

    def text(self, x: float, y: float, text: str, anchor: str = "start", color: str = INK, bold: bool = False) -> None:
        """One line at `x` [px] whose baseline is at `y` [px]."""
        width = len(text) * SIZE * ADVANCE
        left = {"start": x, "middle": x - width / 2, "end": x - width}[anchor]
        self.labels.append(Label(text, left, y - SIZE + 2, width))
        weight = ' font-weight="bold"' if bold else ""
        self.elements.append(
            f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" fill="{color}"{weight}>{escape(text)}</text>'
        )

    def wire(self, *points: tuple[float, float], color: str = SIGNAL) -> None:
        path = " ".join(f"{x:g},{y:g}" for x, y in points)
        self.elements.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="2"/>')

    def dot(self, x: float, y: float, color: str = SIGNAL) -> None:
        """A filled circle around `x`, `y` [px]: wires that cross there are joined."""
        self.elements.append(f'<circle cx="{x:g}" cy="{y:g}" r="3.5" fill="{color}"/>')

    def box(self, left: float, top: float, width: float, height: float, title: str, fill: str = "#f4f6f8") -> None:
        """A part of `width` and `height` [px] from its upper left corner, with its name above it."""
        self.elements.append(
            f'<rect x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}" rx="4" '
            f'fill="{fill}" stroke="{INK}"/>'
        )
        self.text(left + width / 2, top - 7, title, "middle", bold=True)

    def flag(self, x: float, y: float, net: str, color: str, to_left: bool = False) -> None:
        """The name of a net at the end of a wire, at `x`, `y` [px]."""
        width, sign = len(net) * SIZE * ADVANCE + 12, -1 if to_left else 1
        corners = [(0, 0), (6, -10), (width, -10), (width, 10), (6, 10)]
        points = " ".join(f"{x + sign * dx:g},{y + dy:g}" for dx, dy in corners)
        self.elements.append(f'<polygon points="{points}" fill="white" stroke="{color}"/>')
        self.text(x + sign * (width / 2 + 2), y + 4.5, net, "middle", color)

    def resistor(self, x: float, y: float, value: str, upright: bool = False) -> None:
        """Centred at `x`, `y` [px], 40 px long; its value above it, or to its right."""
        width, height = (14, 40) if upright else (40, 14)
        self.elements.append(
            f'<rect x="{x - width / 2:g}" y="{y - height / 2:g}" width="{width}" height="{height}" '
            f'fill="white" stroke="{INK}"/>'
        )
        if upright:
            self.text(x + 12, y + 5, value)
        else:
            self.text(x, y - 12, value, "middle")

    def closed_contact(self, x: float, y: float, color: str) -> None:
        """A contact that opens when it is pressed, 50 px long, from `x`, `y` [px] to the right."""
        self.wire((x, y), (x + 6, y), color=color)
        self.wire((x + 6, y), (x + 46, y - 8), color=color)
        self.wire((x + 40, y - 14), (x + 40, y), (x + 50, y), color=color)

    def svg(self) -> str:
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{self.width}" height="{self.height}" '
            f'viewBox="0 0 {self.width} {self.height}" '
            f'font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="{SIZE}">\n'
            f'<rect width="{self.width}" height="{self.height}" fill="white"/>\n'
        )
        return head + "\n".join(self.elements) + "\n</svg>\n"
