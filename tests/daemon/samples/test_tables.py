"""Constants and sweeps as tables: files, data frames and SQL agree with the journal."""

import csv
import json
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from journal_fits import put_fit
from postgres import reason_why_not
from postgres import running as served
from typer.testing import CliRunner, Result

import pzctl
from pzctl.daemon.cli.commands import app
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.stores.views import COLUMNS
from pzctl.daemon.samples import constant_table
from pzctl.daemon.samples.constant_table import ConstantTable, TableError
from pzctl.daemon.samples.sample_record import UnknownSampleError
from pzctl.daemon.wire.events import InstrumentInfo, SampleStep, StateEvent, SweepEvent, sweep_columns
from pzctl.models.base.errors import PzctlError
from pzctl.models.sweep import Sweep

STIFFNESS = {"S1": 1.48e11, "S2": 1.50e11}


def fill(journal: JournalWriter) -> None:
    """Two samples; S1 measured twice, first badly, and S2 with a measurement that was withdrawn later."""
    put_fit(journal, "S1", 1.1e11)
    for name, c33D in STIFFNESS.items():
        put_fit(journal, name, c33D)
    withdrawn = put_fit(journal, "S2", 9e10)
    journal.append(StateEvent(state="withdrawn", measurement=withdrawn, sample=SampleStep("S2", "disk")))


@pytest.fixture(autouse=True)
def measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    journal = JournalWriter(tmp_path / "journal")
    fill(journal)
    journal.close()
    return tmp_path


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])


def stiffness(rows: "list[dict[str, str]]") -> dict[str, float]:
    return {row["sample"]: float(row["re"]) for row in rows if row["constant"] == "disk.c33D"}


def test_the_three_files_hold_the_same(measured: Path) -> None:
    paths = {kind: measured / f"table.{kind}" for kind in ("csv", "parquet", "xlsx")}
    done = run(
        "samples", "--constants", *(word for kind, path in paths.items() for word in (f"--{kind}", path)), "--json"
    )
    assert json.loads(done.stdout)["rows"] == 4
    with paths["csv"].open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert stiffness(rows) == STIFFNESS
    pandas = pytest.importorskip("pandas")
    frames = [pandas.read_parquet(paths["parquet"]), pandas.read_excel(paths["xlsx"])]
    for frame in (*frames, pzctl.constants().to_pandas()):
        assert list(frame.columns) == list(COLUMNS)
        wide = frame.pivot(index="sample", columns="constant", values="re")
        assert wide["disk.c33D"].to_dict() == STIFFNESS
        assert frame["converged"].all()
        assert not frame.loc[frame["constant"] == "disk.kt", "free"].any()


def test_every_measurement_and_withdrawn_ones_only_when_asked(measured: Path) -> None:
    def lines(*words: str) -> int:
        run("samples", "--constants", "--csv", measured / "t.csv", *words)
        return len((measured / "t.csv").read_text(encoding="utf-8").splitlines()) - 1

    assert [lines(), lines("--every"), lines("--every", "--with-withdrawn")] == [4, 6, 8]


def test_the_views_can_be_queried_with_plain_sqlite(measured: Path) -> None:
    db = sqlite3.connect(f"file:{measured / 'journal' / 'journal.sqlite'}?mode=ro", uri=True)
    query = "SELECT sample, re FROM constants WHERE step = 'disk' AND constant = 'disk.c33D' AND fitter = 'mason'"
    assert dict(db.execute(query).fetchall()) == STIFFNESS
    assert db.execute("SELECT count(*) FROM constants_all WHERE state = 'withdrawn'").fetchone() == (2,)
    named = [column[0] for column in db.execute("SELECT * FROM constants").description]
    assert named[: len(COLUMNS)] == list(COLUMNS)
    db.close()


@pytest.mark.skipif(bool(reason_why_not()), reason=reason_why_not() or "a server is there")
def test_the_views_on_a_server_equal_those_in_a_file(measured: Path, tmp_path: Path) -> None:
    with served() as server:
        for _ in range(2):  # the second finds the views of the first
            journal = JournalWriter(tmp_path / "lock", server.url, "bench1")
            if journal.newest == 0:
                fill(journal)
            journal.close()
        reader, here = JournalReader(server.url, "bench1"), JournalReader(measured / "journal")
        assert stiffness(reader.constants(latest=True)) == STIFFNESS
        for latest in (True, False):
            there, local = reader.constants(latest=latest), here.constants(latest=latest)
            unequal = ("station", "measurement", "measured")
            assert [{**row, **dict.fromkeys(unequal)} for row in there] == [
                {**row, **dict.fromkeys(unequal)} for row in local
            ]
        assert reader.store.all("SELECT count(*) FROM constants") == [(4,)]
        reader.close()
        here.close()


def test_repeats_on_one_axis(measured: Path) -> None:
    xarray = pytest.importorskip("xarray")
    journal = JournalWriter(measured / "journal")
    build = journal.build(journal.measurements()[0].id)
    measurement, _ = journal.begin_measurement("m", build, "disk")
    grids = (np.linspace(1e6, 2e6, 5), np.linspace(1.5e6, 3e6, 4))
    for k, f in enumerate(grids, start=1):
        sweep = Sweep(f, (k + 1j) * np.ones(f.size), id=f"sweep-{k}")
        columns, payload = sweep_columns(sweep)
        info = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)
        event = SweepEvent(
            id=sweep.id,
            measurement=measurement,
            sample=SampleStep("S1", "disk"),
            instrument=info,
            build=build,
            segment=k,
            segments=2,
            started=sweep.time,
            settings={"oscillator_V": 0.5},
            columns=columns,
        )
        journal.append(event, payload)
    journal.append(StateEvent(state="measured", measurement=measurement, sample=SampleStep("S1", "disk")))
    journal.close()
    data = pzctl.sweeps("S1").to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert dict(data.sizes) == {"sweep": 2, "frequency": 7}, "1.5 and 2 MHz are on both grids"
    first = data.impedance.isel(sweep=0).dropna("frequency")
    assert np.array_equal(first.frequency, grids[0])
    assert np.array_equal(first, np.full(5, 1 + 1j))
    assert data.oscillator_V.values.tolist() == [0.5, 0.5]
    assert len(pzctl.sweeps("S1", segment=2).to_pandas()) == 4
    with pytest.raises(UnknownSampleError, match="step 'ml1'"):
        pzctl.sweeps("S1", step="ml1")


def test_a_name_is_not_run_as_a_formula_in_a_spreadsheet() -> None:
    row = {**dict.fromkeys(COLUMNS), "sample": "=cmd()", "re": -1.0}
    assert "'=cmd()" in ConstantTable((row,)).to_csv()
    assert ",-1.0," in ConstantTable((row,)).to_csv()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["samples", "--csv", "t.csv"], "--csv needs --constants: it writes the constants"),
        (["samples", "--constants", "--every"], "--every needs --csv, --parquet or --xlsx"),
        (["samples", "--constants", "--step", "ml1", "--csv", "t.csv"], "holds no fit of step 'ml1'"),
        (["samples", "--constants", "--csv", "/dev/null/t.csv"], "/dev/null/t.csv: the table cannot be written"),
    ],
)
def test_what_cannot_be_is_one_sentence(words: list[str], sentence: str) -> None:
    done = run(*words)
    assert isinstance(done.exception, PzctlError)
    assert sentence in str(done.exception)


def test_a_missing_package_is_named_with_its_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ModuleNotFoundError(name=name)

    monkeypatch.setattr(constant_table, "import_module", missing)
    with pytest.raises(TableError, match="pandas is not installed; this needs it: pip install pandas"):
        pzctl.constants().to_pandas()
