"""Printed boards as PDF pages (ISO 32000-1), with a bar that says whether the printer has kept the scale."""

from __future__ import annotations

from collections.abc import Sequence

from gemelo.libraries.vision.boards import Square
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.schemas.reasons import Reason, because, remedy

POINT = 0.0254 / 72.0  # [m] the unit of a page
PAGES = {"a4": (0.210, 0.297), "letter": (0.2159, 0.2794), "a3": (0.297, 0.420)}  # [m] width and height, upright
BAR = 0.1  # [m] to be measured
EDGE = 0.008  # [m] that printers leave white
BELOW = 0.02  # [m] under the board, for the bar and the text


def page_of(squares: Sequence[Square], size: tuple[float, float], title: str, page: str = "a4") -> bytes:
    """One page with the black `squares` of a board of `size` [m], a bar of 100 mm, and a `title` in ASCII.

    The page lies where the board is wider than high. NotMeasured where the board does not fit.
    """
    width, height = PAGES[page] if size[0] <= size[1] else PAGES[page][::-1]
    room = width - 2.0 * EDGE, height - 2.0 * EDGE - BELOW
    if size[0] > room[0] or size[1] > room[1]:
        raise NotMeasured(_too_small(size, room, page))
    left, lower = (width - size[0]) / 2.0, EDGE + BELOW + (room[1] - size[1]) / 2.0
    drawn = [_rectangle(left + x, lower + y, edge, edge) for x, y, edge in squares]
    drawn += [_rectangle(EDGE, EDGE + 0.006, BAR, 0.0008)]
    drawn += [_rectangle(EDGE + at - 0.0002, EDGE + 0.004, 0.0004, 0.004) for at in (0.0, BAR)]
    drawn += [_text(EDGE, EDGE + 0.011, "100 mm from line to line? Measure it, and give what you measure as --bar")]
    drawn += [_text(EDGE, EDGE, title)]
    return _document("\n".join(drawn), (width, height))


def _too_small(size: tuple[float, float], room: tuple[float, float], page: str) -> Reason:
    larger = tuple(name for name, edges in PAGES.items() if edges > PAGES[page])
    mend = remedy("print_on", pages=larger) if larger else remedy("print_on_plotter")
    (width, height), (room_width, room_height) = (1e3 * size[0], 1e3 * size[1]), (1e3 * room[0], 1e3 * room[1])
    return because(
        "measure.page", mend,
        page=page, width=width, height=height, room_width=room_width, room_height=room_height,
    )  # fmt: skip


def _rectangle(x: float, y: float, width: float, height: float) -> str:
    return f"{x / POINT:.4f} {y / POINT:.4f} {width / POINT:.4f} {height / POINT:.4f} re f"


def _text(x: float, y: float, text: str) -> str:
    plain = text.encode("ascii", "replace").decode().replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
    return f"BT /F1 9 Tf {x / POINT:.4f} {y / POINT:.4f} Td ({plain}) Tj ET"


def _document(content: str, size: tuple[float, float]) -> bytes:
    box = f"[0 0 {size[0] / POINT:.4f} {size[1] / POINT:.4f}]"
    objects = [
        "<< /Type /Catalog /Pages 2 0 R >>",
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>",
        f"<< /Length {len(content)} >>\nstream\n{content}\nendstream",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    text, places = "%PDF-1.4\n", []
    for number, each in enumerate(objects, 1):
        places.append(len(text))
        text += f"{number} 0 obj\n{each}\nendobj\n"
    begin = len(text)
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    text += f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}"
    text += f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{begin}\n%%EOF\n"
    return text.encode("ascii")
