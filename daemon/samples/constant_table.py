"""The constants of all samples as one flat table: for pandas, for files of other programs, and for scripts.

pzctl.constants(step="disk").to_pandas()
"""

import csv
import io
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from ...models.base.errors import PzctlError
from ..journal.journal_reader import JournalReader
from ..journal.stores.views import COLUMNS
from .sample_selection import NoSamplesError, open_journal

_FLAGS = ("free", "derived", "converged")
_TEXT_START = ("=", "+", "-", "@", "\t", "\r")
"""First characters of a formula in a spreadsheet."""


class TableError(PzctlError):
    """A table cannot be made or written: a package is missing, or a path is not writable."""


@dataclass(frozen=True)
class ConstantTable:
    """One row per sample, step, fitter and constant, with the columns of the SQL view `constants`; SI units."""

    rows: tuple[dict[str, Any], ...]

    def to_pandas(self) -> Any:
        """Return a pandas DataFrame. Raises TableError if pandas is not installed."""
        frame = optional("pandas").DataFrame(list(self.rows), columns=list(COLUMNS))
        frame["measured"] = optional("pandas").to_datetime(frame["measured"], utc=True, format="ISO8601")
        return frame

    def to_csv(self) -> str:
        """Return the table as CSV text, with a header row."""
        text = io.StringIO(newline="")
        writer = csv.writer(text)
        writer.writerow(COLUMNS)
        writer.writerows([_plain(row[name]) for name in COLUMNS] for row in self.rows)
        return text.getvalue()

    def write_csv(self, path: Path) -> None:
        """Write the table as CSV. Raises TableError."""
        _write(path, self.to_csv().encode())

    def write_parquet(self, path: Path) -> None:
        """Write the table as Parquet, with typed columns. Raises TableError."""
        arrow: Any = optional("pyarrow")
        kinds = {**dict.fromkeys(COLUMNS, arrow.string()), **dict.fromkeys(_FLAGS, arrow.bool_())}
        numbers = ("re", "im", "u_re", "u_im", "chi2_per_dof", "temperature_C", "mass_g")
        kinds |= dict.fromkeys(numbers, arrow.float64())
        table = arrow.Table.from_pylist(list(self.rows), schema=arrow.schema(list(kinds.items())))
        memory = io.BytesIO()
        optional("pyarrow.parquet").write_table(table, memory)
        _write(path, memory.getvalue())

    def write_xlsx(self, path: Path) -> None:
        """Write the table as an Excel workbook with a header row that stays in view. Raises TableError."""
        book: Any = optional("openpyxl").Workbook()
        sheet = book.active
        sheet.title = "constants"
        sheet.append(list(COLUMNS))
        for row in self.rows:
            sheet.append([_plain(row[name]) for name in COLUMNS])
        sheet.freeze_panes = "A2"
        sheet.auto_filter.ref = sheet.dimensions
        memory = io.BytesIO()
        book.save(memory)
        _write(path, memory.getvalue())


def constants(
    sample: str | None = None,
    step: str | None = None,
    fitter: str | None = None,
    *,
    every: bool = False,
    with_withdrawn: bool = False,
) -> ConstantTable:
    """Return the constants of the latest fit of each sample's step, by fitter; with `every`, of all measurements.

    Raises NoSamplesError, JournalError.
    """
    journal = open_journal()
    try:
        return constants_of(journal, sample, step, fitter, every=every, with_withdrawn=with_withdrawn)
    finally:
        journal.close()


def constants_of(
    journal: JournalReader,
    sample: str | None = None,
    step: str | None = None,
    fitter: str | None = None,
    *,
    every: bool = False,
    with_withdrawn: bool = False,
) -> ConstantTable:
    """Return the table of an open journal; see `constants`. Raises NoSamplesError if it would be empty."""
    wanted = {"sample": sample, "step": step, "fitter": fitter}
    rows = [
        {**row, **{name: None if row[name] is None else bool(row[name]) for name in _FLAGS}}
        for row in journal.constants(latest=not (every or with_withdrawn))
        if all(value in (None, row[name]) for name, value in wanted.items())
        and (with_withdrawn or row["state"] == "measured")
    ]
    if not rows:
        named = ", ".join(f"{name} {value!r}" for name, value in wanted.items() if value is not None)
        raise NoSamplesError(
            f"the journal in {journal.name} holds no fit{f' of {named}' if named else ''}; `pzctl fit --all` makes them"
        )
    return ConstantTable(tuple(rows))


def optional(name: str) -> Any:
    """Return a package that only some users need. Raises TableError if it is not installed."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        package = (error.name or name).partition(".")[0]
        raise TableError(f"{package} is not installed; this needs it: pip install {package}") from None


def _plain(value: Any) -> Any:
    """Return a cell's value; a text that a spreadsheet would take for a formula gets an apostrophe."""
    return f"'{value}" if isinstance(value, str) and value.startswith(_TEXT_START) else value


def _write(path: Path, data: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except OSError as error:
        raise TableError(f"{path}: the table cannot be written: {error.strerror or error}") from None
