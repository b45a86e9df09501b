"""Messages as the first release of wire 1 wrote them: every later release must still read them.

Each file of tests/wire/v1 is one message: per frame its length (4 bytes, little-endian) and its bytes. They are never
regenerated; a new kind of message gets a new file: python tests/daemon/wire/test_golden_messages.py tests/wire/v1
"""

import struct
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

from pzctl.daemon.wire import requests as ask
from pzctl.daemon.wire.events import (
    AnyEvent,
    BeatEvent,
    DiagnosisEvent,
    FitEvent,
    InstrumentInfo,
    ProgressEvent,
    SampleStep,
    StateEvent,
    SweepEvent,
    decode,
    encode,
    sweep_columns,
)
from pzctl.daemon.wire.frames import ColumnHeader, to_json
from pzctl.daemon.wire.result_messages import FitReport, NoiseReport, curve_columns, curves_of
from pzctl.fitters.interface import Constant, Curve
from pzctl.models.build import Build, LayerSpec, LoadSpec, Quantity, Step
from pzctl.models.sweep import Sweep
from pzctl.models.sweep_plan import Segment, SweepPlan

FOLDER = Path(__file__).resolve().parents[2] / "wire" / "v1"
F = np.array([1e6, 2.5e6, 4e6])
Z = np.array([1.0 - 200.0j, 0.1 + 0.2j, -3.5e-3 + 80.0j])
SWEEP = Sweep(F, Z)
CURVE = Curve("disk", F, Z, 2 * Z, Z.conj())
STAMP = {"run": "0197c000-0000-7000-8000-000000000001", "id": "0197d000-0000-7000-8000-000000000002"}
STAMP |= {"time": "2026-11-21T02:14:03.120Z"}
OF = {"measurement": "0197d000-0000-7000-8000-000000000003", "sample": SampleStep("S4.a", "disk")}
AIR = LoadSpec("air", Quantity(413.0))
BUILD = Build(
    name="S4.a",
    area=Quantity(2.01e-4, source="build.toml"),
    layers=(LayerSpec("disk", "piezo", {"c33D": Quantity(1.5e11, 1.4e9, 1e9, 1e8)}, "Pz27"),),
    back=AIR,
    front=AIR,
    steps=(Step("disk", ("disk",)),),
    plan=SweepPlan((Segment(1e6, 6e6, 801), Segment(5e5, 1.55e7, 201, "log")), bias_V=1.5),
)
INSTRUMENT = InstrumentInfo(
    "GPIB0::17::INSTR", "HEWLETT-PACKARD,4294A,JP1KG00123,REV1.11", "4294A", "JP1KG00123", "REV1.11", False
)
REPORT = FitReport(
    build="S4.a",
    fitter="mason",
    version="1",
    steps=("disk",),
    noise=NoiseReport(2e-4, "repeats"),
    chi2_per_dof=1.03,
    constants={"disk.c33D": Constant(1.514e11, 1.4e9, 2e8, None, "Pa")},
    derived={"disk.kt": Constant(0.47, -0.001, 0.002, 0.0, "1", free=False)},
    correlation=(("glue1.thickness", "ml1.thickness", -0.97),),
    rms_log_error=0.0021,
    converged=True,
    evaluations=812,
    seconds=0.09,
    says=("ö µ",),
)
SWEEP_COLUMNS, SWEEP_RAW = sweep_columns(SWEEP)
CURVE_COLUMNS, CURVE_RAW = curve_columns([CURVE])
OF_FITTER = {**OF, "fitter": "mason", "version": "1", "sweeps": (STAMP["id"],)}

EVENTS: dict[str, tuple[AnyEvent, tuple[bytes, ...]]] = {
    "event-sweep": (
        SweepEvent(
            **STAMP,
            **OF,
            seq=412,
            instrument=INSTRUMENT,
            build=BUILD,
            segment=1,
            segments=2,
            started="2026-11-21T02:13:33.000Z",
            settings={"oscillator_V": 0.5, "bandwidth": 5, "temperature": None},
            notes=("polarity inverted",),
            columns=SWEEP_COLUMNS,
        ),
        SWEEP_RAW,
    ),
    "event-progress": (ProgressEvent(**STAMP, **OF, seq=1, fraction=0.5, seconds_left=31.5, what="sweep 1 of 2"), ()),
    "event-state": (StateEvent(**STAMP, **OF, seq=2, state="failed", says="nobody answers"), ()),
    "event-fit": (
        FitEvent(**STAMP, **OF_FITTER, seq=413, report=REPORT, curves=("disk",), columns=CURVE_COLUMNS),
        CURVE_RAW,
    ),
    "event-state-asked": (StateEvent(**STAMP, **OF, seq=3, state="cancelling", client="ana", by="Eva"), ()),
    "event-fit-refused": (FitEvent(**STAMP, **OF_FITTER, seq=414, error="no resonance between 1 and 2 MHz"), ()),
    "event-diagnosis": (DiagnosisEvent(**STAMP, **OF_FITTER, seq=415, diagnosis={"verdict": "no-mismatch"}), ()),
    "event-beat": (BeatEvent(run=STAMP["run"], time=STAMP["time"], seq=415), ()),
}
REQUESTS: dict[str, tuple[ask.AnyRequest, tuple[bytes, ...]]] = {
    "request-hello": (ask.HelloRequest(id="1", fitter="mason", version="1"), ()),
    "request-status": (ask.StatusRequest(id="2"), ()),
    "request-settings": (ask.SettingsRequest(id="3"), ()),
    "request-measure": (ask.MeasureRequest(id="4", build=BUILD, step="disk", plan=BUILD.plan), ()),
    "request-cancel": (ask.CancelRequest(id="5", measurement="m"), ()),
    "request-replay": (ask.ReplayRequest(id="6", since=3, until=9, max=2), ()),
    "request-samples": (ask.SamplesRequest(id="7", name="S4.a"), ()),
    "request-sweeps": (ask.SweepsRequest(id="8", measurement="m"), ()),
    "request-fits": (ask.FitsRequest(id="9", measurement="m"), ()),
    "request-unanswered": (ask.UnansweredRequest(id="10", fitter="mason"), ()),
    "request-submit": (
        ask.SubmitRequest(
            id="11",
            measurement="m",
            fitter="mason",
            version="1",
            sweeps=("s",),
            report=REPORT,
            curves=("disk",),
            columns=CURVE_COLUMNS,
        ),
        CURVE_RAW,
    ),
    "request-bench": (ask.BenchRequest(id="12", command={"command": "step", "name": "ml1"}), ()),
    "request-fit": (ask.FitRequest(id="14", measurement="m", fitter="mason"), ()),
    "request-diagnose": (ask.DiagnoseRequest(id="15", measurement="m", effects=("bond-layer", "cable")), ()),
    "request-lease": (ask.LeaseRequest(id="16", owner="scan", seconds=60.0), ()),
    "request-release": (ask.ReleaseRequest(id="17", lease="l"), ()),
    "request-metrics": (ask.MetricsRequest(id="18"), ()),
    "request-withdraw": (ask.WithdrawRequest(id="19", by="Ana", measurement="m", why="the lead had come off"), ()),
    "request-shutdown": (ask.ShutdownRequest(id="13"), ()),
}


def read(name: str) -> list[bytes]:
    data, frames = (FOLDER / f"{name}.frames").read_bytes(), list[bytes]()
    while data:
        (length,) = struct.unpack_from("<I", data)
        frames.append(data[4 : 4 + length])
        data = data[4 + length :]
    return frames


def write(folder: Path) -> None:
    messages = {name: encode(*message) for name, message in EVENTS.items()}
    messages |= {name: [to_json(request), *raw] for name, (request, raw) in REQUESTS.items()}
    folder.mkdir(parents=True, exist_ok=True)
    for name, frames in messages.items():
        path = folder / f"{name}.frames"
        if not path.exists():
            path.write_bytes(b"".join(struct.pack("<I", len(frame)) + frame for frame in frames))


@pytest.mark.parametrize("name", EVENTS)
def test_events_of_wire_1(name: str) -> None:
    event, raw = EVENTS[name]
    frames = read(name)
    heard = decode(frames)
    assert heard.event == event
    assert frames[0] == event.topic
    assert tuple(frames[2:]) == raw


def test_the_numbers_of_wire_1() -> None:
    sweep = decode(read("event-sweep")).sweep()
    assert np.array_equal(sweep.frequency, F)
    assert np.array_equal(sweep.impedance, Z)
    fit = decode(read("event-fit"))
    (curve,) = curves_of(("disk",), fit.arrays)
    assert np.array_equal(curve.start, 2 * Z)
    assert np.array_equal(curve.fitted, Z.conj())


@pytest.mark.parametrize("name", REQUESTS)
def test_requests_of_wire_1(name: str) -> None:
    request, raw = REQUESTS[name]
    header, *found = read(name)
    assert msgspec.json.decode(header, type=ask.AnyRequest) == request
    assert tuple(found) == raw


def test_every_kind_has_its_message() -> None:
    kinds = {f"event-{kind.__struct_config__.tag}" for kind in AnyEvent.__args__}
    kinds |= {f"request-{kind.__struct_config__.tag}" for kind in ask.AnyRequest.__args__}
    assert kinds <= {path.stem for path in FOLDER.glob("*.frames")}
    assert ColumnHeader("frequency", "Hz", "<f8", (3,)) in decode(read("event-sweep")).event.columns


if __name__ == "__main__":
    write(Path(sys.argv[1]))
