"""The header of a 4294A export: settings, measurement parameter, and a date that may be corrupt."""

import re
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from ..convert import CONVERSIONS, SIGN_LOST
from ..text_file import TextFile, clipped

_WORDS = {
    "IMPH": ("IMPEDANCE MAG PHASE", "Z TH", "Z THETA"),
    "AMPH": ("ADMITTANCE MAG PHASE", "Y TH", "Y THETA"),
    "IRIM": ("IMPEDANCE REAL IMAG", "IMPEDANCE REAL IMAGINARY", "R X"),
    "ARIM": ("ADMITTANCE REAL IMAG", "ADMITTANCE REAL IMAGINARY", "G B"),
    "COMP": ("COMPLEX Z Y",),
    "LSR": ("LS RS",), "LSQ": ("LS Q",), "CSR": ("CS RS",), "CSQ": ("CS Q",), "CSD": ("CS D",),
    "LPG": ("LP G",), "LPQ": ("LP Q",), "LPR": ("LP RP",),
    "CPG": ("CP G",), "CPQ": ("CP Q",), "CPD": ("CP D",), "CPR": ("CP RP",),
    "IMLS": ("Z LS",), "IMCS": ("Z CS",), "IMLP": ("Z LP",), "IMCP": ("Z CP",),
    "IMRS": ("Z RS",), "IMQ": ("Z Q",), "IMD": ("Z D",),
}  # fmt: skip
"""The texts after MEASURE PARAMETER. Two are known from real files (IMPH, AMPH); the others are the labels of the
instrument's menu, and the mnemonics of its command MEAS."""
PARAMETERS = {words: name for name, known in _WORDS.items() for words in (name, *known)}
_SIZE = re.compile(r"([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*([mu]?)(Volt|Amp|V|A|Sec|s)\w*", re.IGNORECASE)
_PREFIX = {"": 1.0, "m": 1e-3, "u": 1e-6}


def parameter_of(page: TextFile, header: Mapping[str, str]) -> str:
    """Return the 4294A's mnemonic of the measurement parameter. Raises RecordingError."""
    parameter = header.get("MEASURE PARAMETER")
    if parameter is None:
        raise page.error(None, "the header has no MEASURE PARAMETER; the file is not a complete export of a 4294A")
    plain = " ".join(re.sub(r"\((DEG|RAD)\)|[^A-Z ]", " ", parameter.upper()).split())
    if plain not in PARAMETERS:
        allowed = ", ".join((*CONVERSIONS, "COMP", *SIGN_LOST))
        raise page.error(None, f"MEASURE PARAMETER {clipped(parameter)!r} is not known; known are {allowed}")
    return PARAMETERS[plain]


def settings_of(page: TextFile, header: Mapping[str, str]) -> dict[str, Any]:
    """Return the settings in the header. Raises RecordingError if it is not a frequency sweep."""
    sweep = header.get("SWEEP TYPE", "")
    if "FREQ" not in sweep.upper():
        raise page.error(None, f"SWEEP TYPE is {clipped(sweep)!r}; a frequency sweep is needed")
    settings: dict[str, Any] = {
        "instrument": header["IDN"],
        "adapter": header.get("ADAPTER", ""),
        "spacing": "log" if "LOG" in sweep.upper() else "linear" if "LIN" in sweep.upper() else "list",
        "bandwidth": _whole(page, header, "BW"),
        "sweep_average": _whole(page, header, "SWEEP AVERAGING"),
        "point_average": _whole(page, header, "POINT AVERAGING"),
    }
    if "TITLE" in header:
        settings["title"] = header["TITLE"]
    for key, name in (("OSC LEVEL", "oscillator"), ("DC BIAS", "bias")):
        size, unit = _size(page, header, key)
        settings[f"{name}_{unit}"] = size
    for key, name in (("POINT DELAY TIME", "point_delay_s"), ("SWEEP DELAY TIME", "sweep_delay_s")):
        settings[name] = _size(page, header, key)[0]
    return settings


def _whole(page: TextFile, header: Mapping[str, str], key: str) -> int | None:
    """Return a whole number, 1 for OFF, or None if the file does not give it."""
    text = header.get(key)
    if text is None:
        return None
    if text.upper() == "OFF":
        return 1
    if not re.fullmatch(r"[0-9]{1,4}", text):
        raise page.error(None, f"{key} is {clipped(text)!r}; a whole number or OFF is needed")
    return int(text)


def _size(page: TextFile, header: Mapping[str, str], key: str) -> tuple[float | None, str]:
    """Return a number in SI units (0 for OFF, None if the file does not give it) and the symbol of its unit."""
    text = header.get(key)
    if text is None or text.upper() == "OFF":
        return None if text is None else 0.0, "V"
    size = _SIZE.fullmatch(text)
    try:
        number = float(size[1]) if size else None
    except ValueError:
        number = None
    if size is None or number is None:
        raise page.error(None, f"{key} is {clipped(text)!r}; a number with its unit, or OFF, is needed")
    return number * _PREFIX[size[2].lower()], size[3][0].upper()


def time_of(header: Mapping[str, str]) -> tuple[str | None, list[str]]:
    """Return the date as RFC 3339, or None with a note if the instrument's clock had lost it."""
    text = header.get("DATE", "")
    try:
        day = datetime.strptime(text, "%b %d %Y")
    except ValueError:
        return None, [f"The date in the file is corrupt ({clipped(text)!r}); the time of the file is used."]
    return day.isoformat(timespec="milliseconds") + "Z", []
