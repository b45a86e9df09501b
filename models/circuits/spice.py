"""An equivalent circuit as a SPICE subcircuit."""

import math
import re

from .lumped import Lumped


def spice_subcircuit(circuit: Lumped, name: str, comments: tuple[str, ...] = ()) -> str:
    """Return the subcircuit of a device between the nodes `hot` and `cold`, in standard SPICE syntax.

    A loss tangent that is the same at all frequencies is no element of SPICE: C0 has a resistor in parallel, with the
    same loss at the strongest resonance. `comments` are lines above it.
    """
    title = re.sub(r"\W", "_", name)
    lines = [*(f"* {line}" for line in comments), f".subckt {title} hot cold"]
    inner = "hot"
    for element, value in (("R", circuit.R), ("L", circuit.L)):
        if value:
            lines.append(f"{element}series {inner} in{element} {value:.9g}")
            inner = f"in{element}"
    lines.append(f"C0 {inner} cold {circuit.C0:.9g}")
    if circuit.tan_delta > 0 and circuit.branches:
        at = max(circuit.branches, key=lambda branch: branch.C).fs
        lines.append(f"R0 {inner} cold {1 / (2 * math.pi * at * circuit.C0 * circuit.tan_delta):.9g}")
    for k, branch in enumerate(circuit.branches, 1):
        lines += [
            f"R{k} {inner} a{k} {branch.R:.9g}",
            f"L{k} a{k} b{k} {branch.L:.9g}",
            f"C{k} b{k} cold {branch.C:.9g}",
        ]
    return "\n".join((*lines, f".ends {title}", ""))
