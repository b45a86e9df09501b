"""The options of `pzctl measure` for notes on the measurement, read into a build."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from ..analysis.fit import UsageError

if TYPE_CHECKING:
    from ....models.build import Build, Quantity


def decimal(text: str) -> float:
    """Return a number typed with a decimal point or comma. Raises typer.BadParameter."""
    try:
        return float(text.replace(",", ".") if text.count(",") == 1 and "." not in text else text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no number") from None


@dataclass(frozen=True)
class NoteOptions:
    """The options as they were typed."""

    operator: str | None = None
    temperature: float | None = None
    mass: str | None = None
    batch: str | None = None
    barcode: str | None = None
    note: Sequence[str] = ()

    def check(self, step: str | None) -> None:
        """Raise UsageError or MetadataError for invalid options."""
        if self.mass is not None and step is None:
            raise UsageError("--mass needs --step: it is the mass of one gluing step")
        self.metadata()
        self.weighed()

    def metadata(self) -> dict[str, str | float]:
        """Return the metadata. Raises UsageError, MetadataError."""
        from ....models.metadata import check_metadata, typed_entry

        given = {
            "operator": self.operator,
            "temperature_C": self.temperature,
            "batch": self.batch,
            "barcode": self.barcode,
        }
        notes: dict[str, str | float] = {key: value for key, value in given.items() if value is not None}
        check_metadata(notes, "metadata")
        for word in self.note:
            key, equals, value = word.partition("=")
            if not (key and equals and value):
                raise UsageError(f"--note {word!r} is not KEY=VALUE, for example humidity_percent=41")
            notes[key] = typed_entry(key, value, "--note")
        return notes

    def weighed(self) -> "Quantity | None":
        """Return the mass. Raises UsageError."""
        from ...samples.measurement_notes import mass_of

        if self.mass is None:
            return None
        try:
            return mass_of(self.mass)
        except ValueError:
            raise UsageError(
                f"--mass {self.mass!r} is not GRAMS:UNCERTAINTY, for example 0.7891:0.0005; the uncertainty is the "
                "balance's standard uncertainty"
            ) from None

    def noted(self, build: "Build", step: str) -> "Build":
        """Return the build with all notes on this measurement. Raises PzctlError."""
        from ...files.config import settings
        from ...samples.measurement_notes import noted_build

        given: dict[str, Any] = settings({})
        return noted_build(build, step, self.metadata(), self.weighed(), given.get("readers", ()))
