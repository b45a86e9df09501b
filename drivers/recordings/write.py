"""Writing a recording as text: the project's own CSV, or Touchstone."""

from pathlib import Path

from ...models.sweep import Sweep
from .atomic_file import write_whole
from .formats.touchstone import touchstone_text
from .provenance import provenance_lines

HEADER = "frequency_Hz,R_ohm,X_ohm"


def csv_text(sweep: Sweep) -> str:
    """Return the recording as the project's CSV: settings and provenance, then numbers with all their digits."""
    pairs = zip(sweep.frequency.tolist(), sweep.impedance.tolist(), strict=True)
    numbers = [f"{f!r},{z.real!r},{z.imag!r}" for f, z in pairs]
    comments = [f"# {line}" for line in provenance_lines(sweep, sweep.frequency.size)]
    return "\n".join((*comments, HEADER, *numbers)) + "\n"


def write_csv(sweep: Sweep, path: Path) -> None:
    """Write the project's CSV, from which `read_recording` returns the same sweep. Raises RecordingError."""
    write_whole(path, csv_text(sweep).encode())


def write_touchstone(sweep: Sweep, path: Path) -> None:
    """Write Touchstone 1 (`# Hz S RI R 50`) with provenance as comments. Raises RecordingError."""
    write_whole(path, touchstone_text(sweep).encode())
