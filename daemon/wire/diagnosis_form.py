"""The form of an untrusted diagnosis: all fields that reports, pictures and the page read have the expected type.

A diagnosis may have further fields, and may lack those with a default here.
"""

from typing import Annotated, Any

import msgspec

from .frames import WireError


class _Size(msgspec.Struct):
    value: float | None
    """None for an infinite or missing number, as everywhere on this wire."""
    unit: str
    u: float | None = None


class _Rival(msgspec.Struct):
    effect: str
    where: str
    probability: float


class _Finding(msgspec.Struct):
    effect: str
    where: str
    step: str
    says: str
    probability: float | None
    bands_Hz: list[tuple[float, float]]
    parameters: dict[str, _Size]
    alternatives: list[_Rival]
    chi2_per_dof_before: float | None = None
    chi2_per_dof_after: float | None = None
    held_out_before: float | None = None
    held_out_after: float | None = None


class _Open(msgspec.Struct):
    effect: str
    where: str
    upper_limit: dict[str, _Size] = {}
    shifts: dict[str, float | None] = {}
    would_decide: str | None = ""


class _Proposal(msgspec.Struct):
    what: str
    why: str
    seconds: float


class _Constant(msgspec.Struct):
    re: float | None = None
    im: float | None = None
    u_re: float | None = None
    u_im: float | None = None
    unit: str = ""
    free: bool = False


class _Side(msgspec.Struct):
    chi2_per_dof: float | None = None
    held_out: float | None = None
    constants: dict[str, _Constant] = {}


class _Diagnosis(msgspec.Struct):
    verdict: str = ""
    says: Annotated[list[str], msgspec.Meta(min_length=1)] | None = None
    baseline: _Side | None = None
    final: _Side | None = None
    findings: list[_Finding] | None = None
    not_decidable: list[_Open] = []
    would_measure: list[_Proposal] = []
    compared: list[str] = []
    held_out_Hz: list[list[tuple[float, float]]] = []


def check_diagnosis(diagnosis: dict[str, Any]) -> None:
    """Raise WireError if a diagnosis has another form."""
    try:
        form = msgspec.convert(diagnosis, _Diagnosis)
    except msgspec.ValidationError as error:
        raise WireError(f"diagnosis: {error}") from None
    if form.findings is not None and form.says is None:
        raise WireError("diagnosis: it has findings and no `says`; the first sentence is its verdict in words")
