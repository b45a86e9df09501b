"""Tables for the terminal in which no name and no number is broken, however narrow the terminal is."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich.box import HEAVY_HEAD, SIMPLE_HEAD, Box
from rich.console import Console, ConsoleOptions, JustifyMethod, RenderableType, RenderResult
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

_PROSE = 20
"""Smallest width of a column of prose in a table; a narrower terminal gets one block of lines for each row."""
_BREAKS = re.compile(r" (?=[+-] \S+ j\b|-> )")
"""Where a cell may go on in a new line: before the imaginary part of a constant, and before what a value became."""


@dataclass(frozen=True)
class Column:
    """A column: `prose` may be wrapped between words, anything else stays in its line."""

    name: str
    justify: JustifyMethod = "left"
    prose: bool = False
    spare: int = 0
    """Order of being left out of a table that is too wide, from 1; 0: never."""


@dataclass(frozen=True)
class _Row:
    cells: tuple[Text, ...]
    style: str | None
    ends_section: bool = False


class UnbrokenTable:
    """A table that fits the terminal without breaking names or numbers.

    Too wide a table goes without its frame; then complex constants take two lines; then spare columns are left out,
    which the line below says; then each row becomes a block of lines.
    """

    def __init__(self, *columns: Column | str, title: str = "", box: Box | None = HEAVY_HEAD) -> None:
        self.columns = tuple(Column(column) if isinstance(column, str) else column for column in columns)
        self.title = title
        self.rows: list[_Row] = []
        self._box = box

    def add_row(self, *cells: str | Text, style: str | None = None) -> None:
        """Add a row with cells for the first columns, the others empty; text is shown as it is, without markup."""
        filled = (*cells, *[""] * (len(self.columns) - len(cells)))
        self.rows.append(_Row(tuple(Text(cell) if isinstance(cell, str) else cell for cell in filled), style))

    def add_section(self) -> None:
        """Draw a line below the row that was added last."""
        if self.rows:
            last = self.rows[-1]
            self.rows[-1] = _Row(last.cells, last.style, ends_section=True)

    def column(self, index: int) -> list[str]:
        """Return the text of a column's cells."""
        return [row.cells[index].plain for row in self.rows]

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(1, options.max_width)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        wide, every = options.max_width, tuple(range(len(self.columns)))
        if self._fits(every, self.rows, wide - self._frame(every)):
            yield self._drawn(every, self.rows, wide, framed=True)
            return
        narrow = [_Row(tuple(map(_narrow, row.cells)), row.style, row.ends_section) for row in self.rows]
        for kept, rows in ((every, self.rows), *((kept, narrow) for kept in self._choices())):
            if self._fits(kept, rows, wide - _gaps(kept)):
                yield self._drawn(kept, rows, wide, framed=False)
                left = [column.name for k, column in enumerate(self.columns) if k not in kept]
                if left:
                    yield Text(f"not shown at this width: {'; '.join(left)}", style="dim")
                return
        yield from self._blocks(narrow)

    def _choices(self) -> list[tuple[int, ...]]:
        """Return the columns to keep: all, then without each spare one in turn."""
        spare = sorted((column.spare, k) for k, column in enumerate(self.columns) if column.spare)
        gone = [k for _, k in spare]
        return [tuple(k for k in range(len(self.columns)) if k not in gone[:n]) for n in range(len(gone) + 1)]

    def _frame(self, kept: Sequence[int]) -> int:
        return 3 * len(kept) + 1 if self._box is not None else _gaps(kept)

    def _fits(self, kept: Sequence[int], rows: Sequence[_Row], wide: int) -> bool:
        return sum(self._least(k, rows) for k in kept) <= wide

    def _least(self, k: int, rows: Sequence[_Row]) -> int:
        """Return the smallest width of column `k`: of its longest line, or of its longest word if it is prose."""
        cells, header = [row.cells[k].plain for row in rows], self.columns[k].name
        whole = _widest(line for cell in cells for line in cell.split("\n"))
        words = _widest(word for cell in (*cells, header) for word in cell.split())
        return max(words, min(whole, _PROSE)) if self.columns[k].prose else max(whole, _widest(header.split()))

    def _widths(self, kept: Sequence[int], rows: Sequence[_Row], wide: int) -> list[int]:
        """Return the width of each column: what headers and prose can use of the room is theirs."""
        widths = [self._least(k, rows) for k in kept]
        left = wide - sum(widths)
        for prose in (False, True):
            for n, k in enumerate(kept):
                if self.columns[k].prose is prose:
                    wish = max(Text(self.columns[k].name).cell_len, _widest(_lines(rows, k)))
                    share = left // sum(1 for other in kept[n:] if self.columns[other].prose) if prose else left
                    more = max(0, min(wish - widths[n], share))
                    widths[n] += more
                    left -= more
        return widths

    def _drawn(self, kept: Sequence[int], rows: Sequence[_Row], wide: int, *, framed: bool) -> Table:
        framed = framed and self._box is not None
        table = Table(
            title=self.title or None,
            title_justify="left",
            header_style="bold",
            box=self._box if framed else SIMPLE_HEAD,
            show_edge=framed,
            pad_edge=framed,
            padding=(0, 1) if framed else (0, 1, 0, 0),
        )
        widths = self._widths(kept, rows, wide - (self._frame(kept) if framed else _gaps(kept)))
        for width, k in zip(widths, kept, strict=True):
            table.add_column(Text(self.columns[k].name), justify=self.columns[k].justify, width=width)
        for row in rows:
            table.add_row(*(row.cells[k] for k in kept), style=row.style, end_section=row.ends_section)
        return table

    def _blocks(self, rows: Sequence[_Row]) -> Iterable[RenderableType]:
        """Yield each row as a heading and one line, or more, for each further cell that is not empty."""
        if self.title:
            yield Text(self.title, style="italic")
        for row in rows:
            if row.cells[0].plain:
                yield Text(row.cells[0].plain, style="bold")
            lines = Table(box=None, show_header=False, padding=(0, 1, 0, 0), pad_edge=False)
            lines.add_column(no_wrap=True, style="dim")
            lines.add_column(overflow="fold")
            for column, cell in zip(self.columns[1:], row.cells[1:], strict=True):
                if cell.plain:
                    lines.add_row(Text(column.name), cell)
            yield Padding(lines, (0, 0, 0, 2))


def _narrow(cell: Text) -> Text:
    return Text(_BREAKS.sub("\n", cell.plain), style=cell.style)


def _lines(rows: Iterable[_Row], k: int) -> Iterable[str]:
    return (line for row in rows for line in row.cells[k].plain.split("\n"))


def _widest(texts: Iterable[str]) -> int:
    return max((Text(text).cell_len for text in texts), default=0)


def _gaps(kept: Sequence[int]) -> int:
    return 2 * (len(kept) - 1)
