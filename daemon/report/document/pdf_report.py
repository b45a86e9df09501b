"""The report as PDF: the sections of the HTML report, set on pages by fpdf2, with vector pictures.

fpdf2 is plain Python and needs no browser, so it works on any machine with pip.
"""

import io
import logging
import re
from collections.abc import Iterable
from html.parser import HTMLParser
from pathlib import Path

from fpdf import FPDF, FontFace

_FAMILY = "DejaVu Sans"
_TEXT, _SMALL = 9.5, 7.0
"""Sizes in points."""
_HEADS = {"h1": 18.0, "h2": 13.0}
_COLOURS = {"near": (227, 243, 230), "off": (253, 243, 211), "far": (251, 220, 214)}
"""Background of the deviation's cell, as in the HTML report; of the verdict's cell likewise."""
_COLOURED = {
    **{name: (4, colour) for name, colour in _COLOURS.items()},
    **{name: (6, _COLOURS[like]) for name, like in (("pass", "near"), ("undecided", "off"), ("fail", "far"))},
}
"""The coloured cell of a row of this class, and its colour."""
_PICTURE = re.compile(r"(<svg.*?</svg>)", re.DOTALL)
_BOX = re.compile(r'viewBox="[^"]*"')
_MM = 25.4 / 72
"""Millimetres in a point."""
_WIDEST, _EDGE = 75.0, 3.0
"""Greatest width of a column, and the margin beside its text, in millimetres."""
_BOLD = 1.12
"""Width of bold text, as in headings, relative to normal text."""


def report_pdf(html: str) -> bytes:
    """Return the result of `report_html` as a PDF file."""
    logging.getLogger("fpdf").setLevel(logging.ERROR)
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    paper = _Paper(format="A4")
    paper.set_margins(15, 15)
    paper.set_auto_page_break(auto=True, margin=18)
    for style, name in (("", "DejaVuSans.ttf"), ("B", "DejaVuSans-Bold.ttf")):
        paper.add_font(_FAMILY, style, _fonts() / name)
    paper.add_page()
    reader = _Reader(paper)
    for part in _PICTURE.split(html):  # a picture is XML and is passed on unchanged
        if part.startswith("<svg"):
            reader.picture(part)
        else:
            reader.feed(part)
    return bytes(paper.output())


def _fonts() -> Path:
    """Return the folder of matplotlib's fonts, which include Greek letters."""
    import matplotlib as mpl

    return Path(mpl.get_data_path()) / "fonts" / "ttf"


class _Paper(FPDF):
    """A4 pages with a page number at the foot."""

    def footer(self) -> None:
        """Write the page number at the foot."""
        self.set_y(-12)
        self.set_font(_FAMILY, "", _SMALL)
        self.cell(0, 5, f"{self.page_no()}", align="C")


class _Reader(HTMLParser):
    """Parses the report and sets headings, paragraphs, tables and pictures in their order."""

    def __init__(self, paper: FPDF) -> None:
        super().__init__()
        self._paper = paper
        self._text: list[str] = []
        self._rows: list[tuple[str, list[str]]] = []
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Start an element."""
        if tag == "table":
            self._rows = []
        elif tag == "tr":
            self._rows.append((dict(attrs).get("class") or "", []))
        elif tag in ("h1", "h2", "p", "td", "th", "style", "title"):
            self._inside, self._text = tag, []

    def handle_data(self, data: str) -> None:
        """Collect text."""
        self._text.append(data)

    def handle_endtag(self, tag: str) -> None:
        """Set an element that is complete."""
        if tag in ("td", "th"):
            self._rows[-1][1].append("".join(self._text))
        elif tag == "table":
            self._table()
        elif tag in _HEADS:
            self._heading(tag)
        elif tag == "p" and self._inside == "p":
            self._paper.set_font(_FAMILY, "", _TEXT)
            self._paper.multi_cell(0, 5, "".join(self._text), align="L", new_x="LMARGIN", new_y="NEXT")
            self._paper.ln(1)

    def _heading(self, tag: str) -> None:
        if self._paper.will_page_break(30):
            self._paper.add_page()
        self._paper.set_font(_FAMILY, "B", _HEADS[tag])
        self._paper.ln(3)
        self._paper.multi_cell(0, 8, "".join(self._text), align="L", new_x="LMARGIN", new_y="NEXT")

    def _table(self) -> None:
        paper = self._paper
        paper.set_font(_FAMILY, "", _SMALL)
        widths = _widths(paper, [cells for _, cells in self._rows])
        with paper.table(
            col_widths=widths, borders_layout="HORIZONTAL_LINES", text_align="LEFT", line_height=4
        ) as table:
            for classed, cells in self._rows:
                row = table.row()
                for k, cell in enumerate(cells):
                    column, colour = _COLOURED.get(classed, (None, None))
                    row.cell(cell, style=FontFace(fill_color=colour) if colour and k == column else None)
        paper.ln(2)

    def picture(self, svg: str) -> None:
        """Set a picture in its size, or reduced to the width or height of the page."""
        width, height = (float(x) for x in re.findall(r"[\d.]+", _BOX.findall(svg)[0])[2:4])
        wide = min(self._paper.epw, width * _MM)
        tall = wide * height / width
        if tall > self._paper.eph:
            wide, tall = wide * self._paper.eph / tall, self._paper.eph
        if self._paper.will_page_break(tall + 2):
            self._paper.add_page()
        self._paper.image(io.BytesIO(svg.encode()), w=wide, h=tall)
        self._paper.ln(2)


def _widths(paper: FPDF, rows: list[list[str]]) -> tuple[float, ...]:
    """Return the widths of the columns (mm): wide enough for each word; spare width goes to columns that would wrap."""
    columns = [[cell for cell in column if cell] for column in zip(*rows, strict=False)]
    need = [min(_WIDEST, _EDGE + _widest(paper, (w for cell in column for w in cell.split()))) for column in columns]
    want = [min(_WIDEST, _EDGE + _widest(paper, column)) for column in columns]
    spare, wish = paper.epw - sum(need), sum(want) - sum(need)
    part = min(1.0, max(0.0, spare) / wish) if wish else 0.0
    return tuple(low + part * (high - low) for low, high in zip(need, want, strict=True)) or (1.0,)


def _widest(paper: FPDF, texts: Iterable[str]) -> float:
    return max((_BOLD * paper.get_string_width(text) for text in texts), default=0.0)
