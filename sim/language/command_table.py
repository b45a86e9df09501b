"""The facts of the programming manual's command reference: every mnemonic, its range, initial value and page.

`commands.csv` has one line for each. `value` says what a setting takes: `switch`, `token A|B`, `int low high`,
`real low high unit step`, `ints count low high`, `text length`, `radio A|B` (setting one clears the other); `action` is
a command without effect on measured data, `reads 0` a query that always answers this.
A mnemonic has its own code where `scope` is `code` or a dictionary of commands names it. Otherwise `scope` says what a
setting belongs to: `trace` (each trace has one), `item` (each colour has one), `kept` (a preset does not change it).
`needs` names conditions of `conditions`.
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files


@dataclass(frozen=True)
class Row:
    """One line of the command reference."""

    mnemonic: str
    query: str
    """`none`: command only; `only`: query only; `also`: both."""
    value: str
    initial: str
    scope: str
    needs: tuple[str, ...]
    page: int
    """Page of the programming manual 04294-90061, eighth edition."""

    @property
    def kind(self) -> str:
        """The first word of `value`."""
        return self.value.partition(" ")[0]

    @property
    def rest(self) -> str:
        """What follows the first word of `value`."""
        return self.value.partition(" ")[2]


def _rows() -> Mapping[str, Row]:
    text = files(__name__.rpartition(".")[0]).joinpath("commands.csv").read_text(encoding="utf-8")
    return {
        r["mnemonic"]: Row(
            r["mnemonic"], r["query"], r["value"], r["initial"], r["scope"], tuple(r["needs"].split()), int(r["page"])
        )
        for r in csv.DictReader(text.splitlines())
    }


ROWS: Mapping[str, Row] = _rows()
"""By mnemonic."""
