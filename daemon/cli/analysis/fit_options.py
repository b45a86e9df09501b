"""The options of `pzctl fit`: constants to free, hold, tie and bound, and how to fit them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

from ....models.base.errors import PzctlError

if TYPE_CHECKING:
    from ....fitters.engine.parameters.overrides import Amendments
    from ....fitters.interface import Fitter, Options


_CONSTANTS = "disk.c33D,ml1.z"


class UsageError(PzctlError):
    """A command line that is incomplete or contradicts itself."""


@dataclass(frozen=True)
class FitArguments:
    """The options of `pzctl fit` as they were typed."""

    hold: str | None = None
    tie: Sequence[str] = ()
    prior: Sequence[str] = ()
    bound: Sequence[str] = ()
    objective: str = "log"
    uncertainty: str = "covariance"
    sequential: bool = False
    freeze: bool = False

    def amendments(self, free: tuple[str, ...] | None) -> "Amendments":
        """Return the changes to the build file that the options ask for. Raises UsageError."""
        from ....fitters.engine.parameters.overrides import Amendments

        hold = comma_names("--hold", self.hold, _CONSTANTS) if self.hold is not None else ()
        both = sorted(set(hold) & set(free or ()))
        if both:
            raise UsageError(f"{both[0]} is given to both --free and --hold; give it to one of the two")
        return Amendments(
            hold=hold,
            tie=tuple(_tie(word) for word in self.tie),
            prior=tuple(_numbers("--prior", word, "VALUE:UNCERTAINTY", "ml1.z=10.3e6:0.5e6") for word in self.prior),
            bound=tuple(_numbers("--bound", word, "LOWEST:HIGHEST", "ml1.c=2200:2700") for word in self.bound),
        )

    def options(self) -> "Options":
        """Return the fitter's options. Raises UsageError."""
        from ....fitters.interface import Options

        if self.sequential and self.freeze:
            raise UsageError("--sequential and --freeze exclude each other; give one of the two")
        objective: Any = _choice("objective", self.objective)
        uncertainty: Any = _choice("uncertainty", self.uncertainty)
        if objective != "log" and uncertainty == "profile":
            raise UsageError(f"--uncertainty profile needs the noise-weighted objective log, not {objective}")
        procedure = "sequential" if self.sequential else "frozen" if self.freeze else "joint"
        return Options(objective, uncertainty, procedure)


@dataclass(frozen=True)
class FitSelection:
    """The constants to free, the changes to the build and the options of a fit, or of the fits of all samples."""

    free: tuple[str, ...] | None
    amendments: "Amendments"
    options: "Options"


def comma_names(option: str, text: str, example: str) -> tuple[str, ...]:
    """Return the names that an option lists with commas between them. Raises UsageError."""
    names = tuple(name.strip() for name in text.split(","))
    if not all(names):
        raise UsageError(f"{option} is {text!r}; give names with commas between them, for example {example}")
    return names


def free_names(text: str | None) -> tuple[str, ...] | None:
    """Return the names of --free, or None if it was not given. Raises UsageError."""
    return None if text is None else comma_names("--free", text, _CONSTANTS)


def check_options(fitter: "Fitter", options: "Options") -> None:
    """Refuse options that a fitter does not know. Raises UsageError."""
    from ....fitters.interface import Options

    if options != Options() and not getattr(fitter, "takes_options", False):
        raise UsageError(
            f"{fitter.name} does not know --objective, --uncertainty, --sequential and --freeze; the fitter mason does"
        )


def _choice(name: str, word: str) -> str:
    from ....fitters.interface import Options

    allowed = get_args(get_type_hints(Options)[name])
    if word not in allowed:
        raise UsageError(f"--{name} is {word!r}; {', '.join(allowed[:-1])} or {allowed[-1]} is needed")
    return word


def _tie(word: str) -> tuple[str, str]:
    name, equals, leader = word.partition("=")
    if not (name and equals and leader):
        raise UsageError(f"--tie {word!r} is not NAME=NAME, for example glue2.z=glue1.z")
    return name.strip(), leader.strip()


def _numbers(option: str, word: str, form: str, example: str) -> tuple[str, float, float]:
    name, equals, rest = word.partition("=")
    first, colon, second = rest.partition(":")
    try:
        numbers = float(first), float(second)
    except ValueError:
        numbers = math.nan, math.nan
    if not (name and equals and colon and all(map(math.isfinite, numbers))):
        raise UsageError(f"{option} {word!r} is not NAME={form} in SI units, for example {example}")
    return name.strip(), *numbers
