"""A comparison in words and tables for the terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from ....fitters.engine.swapped_steps import WRONG
from ....models.base.plain_numbers import without_exponent
from ....models.base.uncertain_numbers import with_uncertainty
from ..probability import probability_text
from .unbroken_table import Column, UnbrokenTable


def print_comparison(console: Console, found: Mapping[str, Any]) -> None:
    """Print a comparison (the object of `comparison_json`): the verdict in plain words, then the evidence."""
    console.print(found["says"][0], style="bold", highlight=False)
    for sentence in found["says"][1 : len(found["says"]) - len(found["findings"])]:
        console.print(sentence, highlight=False)
    for finding in found["findings"]:
        console.print(f"- {finding['where']}: {finding['says']}", style="yellow", highlight=False)
    if found["findings"]:
        console.print(_findings_table(found["findings"]))
    if found["described_by"]:
        console.print(_described(found["described_by"]), highlight=False)
    if found["limits"]:
        console.print(f"Not seen, at 95 %: {'; '.join(_limit(one) for one in found['limits'])}.", highlight=False)
    if found["resonances"]:
        console.print(_resonance_table(found["resonances"]))
    console.print(_bands_table(found["repeatability"]))
    console.print(f"probability {probability_text(found['probability'])}; {found['seconds']:.1f} s", highlight=False)


def print_many(console: Console, found: Mapping[str, Any]) -> None:
    """Print a comparison of several devices (the object of `many_json`): the common changes, then each device."""
    for k, sentence in enumerate(found["says"]):
        console.print(sentence if k == 0 else f"- {sentence}", style="bold" if k == 0 else "yellow", highlight=False)
    for one in found["common"]:
        sizes = [
            f"{name} {_size(size)}, from device to device {one['scatter'][name]['value']:.2g}{_unit(size)}"
            for name, size in one["parameters"].items()
        ]
        console.print(f"{one['effect']}: {'; '.join(sizes)}", highlight=False)
    table = UnbrokenTable("device", "verdict", "change (%)", Column("findings", prose=True))
    for device in found["devices"]:
        findings: list[str] = []
        for one in device["findings"]:
            name, size = next(iter(one["parameters"].items()), ("", None))
            findings.append(f"{one['effect']}{' (gone)' if one['removed'] else ''}{_first(name, size)}")
        if not findings and device["verdict"] == "unexplained":
            findings = _moved(device["resonances"])
        mark = " !" if device["file"] in found["outliers"] else ""
        table.add_row(
            device["file"] + mark, device["verdict"], without_exponent(100 * device["change"], 3), "\n".join(findings)
        )
    console.print(table)


def _moved(resonances: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return how the best known resonance differs, of a device for which nothing else can be said."""
    if not resonances:
        return []
    one = min(resonances, key=lambda one: one["u_shift"])
    shift = with_uncertainty(100 * one["shift"], 100 * one["u_shift"])
    ratios = [f"{name} x {one[key]:.3g}" for name, key in (("Q", "q_ratio"), ("strength", "strength_ratio"))]
    return [f"resonance at {one['frequency_Hz'] / 1e3:.5g} kHz: {shift} %, {', '.join(ratios)}"]


def _first(name: str, size: Mapping[str, Any] | None) -> str:
    return f", {name} {_size(size)}" if size else ""


def _findings_table(findings: Sequence[Mapping[str, Any]]) -> UnbrokenTable:
    table = UnbrokenTable("effect", "where", "probability", "size", "held out", "cannot be told from")
    for finding in findings:
        sizes = [f"{name} {_size(size)}" for name, size in finding["parameters"].items()]
        alike = [f"{one['effect']} ({one['probability']:.2f})" for one in finding["same_as"]]
        held = [finding["held_out_before"], finding["held_out_after"]]
        table.add_row(
            finding["effect"] + (" (gone)" if finding["removed"] else ""),
            finding["where"],
            probability_text(finding["probability"]),
            "\n".join(sizes),
            " -> ".join("-" if value is None else f"{value:.3g}" for value in held),
            "\n".join(alike),
        )
    return table


def _described(by: Mapping[str, Any]) -> str:
    left = f"{100 * by['rms_log_error']:.2g} %"
    says = f"Build {by['build']}, step {by['step']}: it describes the recording before to {left}"
    if by["rms_log_error"] > WRONG:
        return f"{says} only: check that build and step are those of that recording; what changed inside is not seen."
    return f"{says}; that rest cancels. The probabilities hold if this is the build of the device."


def _resonance_table(resonances: Sequence[Mapping[str, Any]]) -> UnbrokenTable:
    columns = ("kHz", "Q", "frequency moved (ppm)", "Q after/before", "strength after/before")
    title = "Resonances in both, as the terminals see them"
    table = UnbrokenTable(*(Column(column, justify="right") for column in columns), title=title)
    for one in resonances:
        table.add_row(
            f"{one['frequency_Hz'] / 1e3:.5g}",
            f"{one['q']:.3g}",
            with_uncertainty(1e6 * one["shift"], 1e6 * one["u_shift"]),
            with_uncertainty(one["q_ratio"], one["u_q_ratio"]),
            with_uncertainty(one["strength_ratio"], one["u_strength_ratio"]),
        )
    return table


def _bands_table(bands: Sequence[Mapping[str, Any]]) -> UnbrokenTable:
    columns = ("band (kHz)", "|Z| (%)", "phase (mrad)", "noise (%)")
    title = "By how much they differ (rms)"
    table = UnbrokenTable(*(Column(column, justify="right") for column in columns), title=title)
    for band in bands:
        low, high = band["band_Hz"]
        table.add_row(
            f"{low / 1e3:.5g}-{high / 1e3:.5g}",
            without_exponent(100 * band["magnitude"], 3),
            without_exponent(1e3 * band["phase"], 3),
            without_exponent(100 * band["noise"], 2),
        )
    return table


def _limit(limit: Mapping[str, Any]) -> str:
    sizes = [f"{name} above {size['value']:.2g}{_unit(size)}" for name, size in limit["upper_limit"].items()]
    return f"{limit['effect']}, {' and '.join(sizes)}"


def _size(size: Mapping[str, Any]) -> str:
    return f"{with_uncertainty(size['value'], size['u'])}{_unit(size)}"


def _unit(size: Mapping[str, Any]) -> str:
    return "" if size["unit"] == "1" else f" {size['unit']}"
