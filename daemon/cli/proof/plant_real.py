"""Blind cases made from real recordings by adding circuit parts with an exact model.

`python -m pzctl.daemon.cli.proof.plant_real FOLDER OUT SEED` writes them and prints the hash of their truth.
Every readable recording in the folder that has a build gives one unchanged case, for comparison, and one case with each
part. The build is the `build.toml` beside the recording, or else the file in `real_builds` named after its folder.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ....drivers.recordings import read_recording
from ....models.base.errors import CannotError, PzctlError
from ....models.sweep import Sweep
from ....sim.blind_cases.case_files import seal
from ....sim.blind_cases.planted_parts import PARTS, Part, alike, moves, own_noise, sized
from ....sim.blind_cases.waves import Complexes, Reals
from ...files.builds.build_file import parse_build

_MOVES = 0.05, 0.3
"""Range of the root mean square change of ln Z that a part makes; drawn uniformly in its logarithm. More where a
fixture may leave as much as that."""
_IN_TIME = 0.2
"""Factor on this change for a drift or a lag."""
_SUFFIXES = frozenset({".csv", ".txt", ".tsv", ".s1p", ".z1p", ".y1p"})
_SECONDS = 100.0
"""Duration stated for each sweep of a pair; only the drift or lag within one sweep matters."""


class NothingToPlantError(CannotError):
    """The folder holds no recording that a part could be added to."""


@dataclass(frozen=True, eq=False)
class Source:
    """A real recording with its build."""

    name: str
    """Usable as a file name."""
    step: str
    build: str
    frequency: Reals
    """Hz, rising, shape (N,)."""
    impedance: Complexes
    """ohm, shape (N,)."""
    settings: dict[str, float]


def plant_all(folder: Path, out: Path, seed: int) -> str:
    """Write all cases of a folder below OUT/cases and seal their truth; return its hash. Raises NothingToPlantError."""
    truths: list[dict[str, Any]] = []
    for number, source in enumerate(sources(folder)):
        rng = np.random.default_rng([seed, number])
        truths.append(_bare(source, out / "cases"))
        planted = (_planted(source, part, out / "cases", rng) for part in PARTS)
        truths += [case for case in planted if case is not None]
    if not truths:
        raise NothingToPlantError(f"{folder}: no recording with a build.toml beside it; `pzctl new` writes one")
    return seal(out, truths)


def sources(folder: Path) -> Iterator[Source]:
    """Yield all recordings below a folder that have a build, by name; skip files that are no recordings.

    Raises BuildError if a build file is not valid.
    """
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in _SUFFIXES:
            continue
        text = _build_of(path)
        if text is None:
            continue
        steps = [step.name for step in parse_build(text, str(path.parent / "build.toml")).steps]
        try:
            sweep = read_recording(path)
        except PzctlError:
            continue
        step = path.stem if path.stem in steps else steps[-1]
        yield _source(f"{path.parent.name}.{path.stem}", step, text, sweep)


def _build_of(path: Path) -> str | None:
    beside = path.parent / "build.toml"
    if beside.exists():
        return beside.read_text(encoding="utf-8")
    ours = files("pzctl.daemon.cli.proof") / "real_builds" / f"{path.parent.name}.toml"
    return ours.read_text(encoding="utf-8") if ours.is_file() else None


def _source(name: str, step: str, build: str, sweep: Sweep) -> Source:
    order = np.argsort(sweep.frequency, kind="stable")
    f, first = np.unique(sweep.frequency[order], return_index=True)
    known = {key: sweep.settings[key] for key in ("bandwidth", "oscillator_V") if key in sweep.settings}
    settings = {key: float(value) for key, value in known.items() if isinstance(value, int | float)}
    return Source(name, step, build, np.asarray(f), np.asarray(sweep.impedance[order][first]), settings)


def _bare(source: Source, cases: Path) -> dict[str, Any]:
    name = f"{source.name}-as-it-is"
    _write(source, cases / name, source.impedance)
    return {"name": name, "kind": "bare", "source": source.name}


def _planted(source: Source, part: Part, cases: Path, rng: np.random.Generator) -> dict[str, Any] | None:
    f, z = source.frequency, source.impedance
    wanted = float(np.exp(rng.uniform(math.log(_MOVES[0]), math.log(_MOVES[1])))) * (_IN_TIME if part.in_time else 1.0)
    size = sized(part, f, z, wanted)
    if size is None:
        return None
    name = f"{source.name}-{part.effect}"
    changed = part.apply(f, z, size, False)
    if part.in_time:
        # two sweeps made from one recording would share its noise: add independent noise of the same size to each
        sigma = own_noise(z)
        for k, swept in enumerate((changed, part.apply(f, z, size, True))):
            noise = sigma * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
            _write(source, cases / name, swept * (1 + noise), k, down=k == 1)
    else:
        _write(source, cases / name, changed)
    return {
        "name": name,
        "kind": "planted",
        "source": source.name,
        "bare": f"{source.name}-as-it-is",
        "effect": part.effect,
        "where": part.where,
        "parameter": part.size,
        "size": size,
        "moves": moves(z, changed),
        "alike": {other: part.others[other] for other in alike(part, f, z, size)},
    }


def _write(source: Source, place: Path, z: Complexes, number: int | None = None, down: bool = False) -> None:
    """Write a case's build and one recording, in the order in which it was swept, with nine digits."""
    place.mkdir(parents=True, exist_ok=True)
    (place / "build.toml").write_text(source.build, encoding="utf-8")
    lines = [f"# {key}: {value:g}" for key, value in source.settings.items()]
    if number is not None:
        lines.append(f"# sweep_seconds: {_SECONDS:g}")
    if down:
        lines.append("# direction: down")
    rows = [f"{f:.6f},{v.real:.8e},{v.imag:.8e}" for f, v in zip(source.frequency, z, strict=True)]
    text = "\n".join([*lines, "frequency_Hz,R_ohm,X_ohm", *(rows[::-1] if down else rows)]) + "\n"
    (place / (f"{source.step}-{number + 1}.csv" if number else f"{source.step}.csv")).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    try:
        print(plant_all(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])))
    except PzctlError as error:
        sys.exit(str(error))
