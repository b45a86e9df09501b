"""The FTP server used with Python's ftplib: anonymous login, files generated when they are fetched."""

import ftplib
import io

import numpy as np
import pytest

from pzctl.drivers.recordings import read_data_trace


@pytest.fixture
def lab(lab_with):
    return lab_with(ftp_port=0, noise=False)


@pytest.fixture
def ftp(lab):
    with ftplib.FTP() as client:  # noqa: S321
        client.connect("127.0.0.1", lab.sim.ftp_port, 10)
        client.login()
        yield client


def fetched(ftp, path):
    got = io.BytesIO()
    ftp.retrbinary(f"RETR {path}", got.write)
    return got.getvalue()


def test_screen_data_and_saved_files_are_fetched(lab, ftp, tmp_path):
    wire = lab.wire()
    wire.say("*RST;STAR 1 MHZ;STOP 6 MHZ;POIN 51;MEAS COMP;SING;*OPC?")
    assert wire.line() == "1\n"
    wire.say('SAVDASC "disk";FSIZE? "disk.TXT"')
    size = int(wire.line())

    assert fetched(ftp, "/data/screen.tif")[:2] in (b"II", b"MM")
    (tmp_path / "data_dt.dat").write_bytes(fetched(ftp, "/data/data_dt.dat"))
    trace = read_data_trace(tmp_path / "data_dt.dat", np.linspace(1e6, 6e6, 51), "COMP")
    np.testing.assert_allclose(trace.impedance, wire.impedance(), rtol=1e-6)
    listed = []
    ftp.dir("/int", listed.append)
    assert [line.split()[-1] for line in listed] == ["disk.TXT"]
    ftp.cwd("/int")
    assert len(fetched(ftp, "disk.TXT")) == size
    assert sorted(name for name, _ in ftp.mlsd("/")) == ["data", "int", "nvram", "ram"]


def test_missing_files_and_writing_are_refused(ftp):
    with pytest.raises(ftplib.error_perm, match="550"):
        fetched(ftp, "/data/absent.dat")
    with pytest.raises(ftplib.error_perm, match="550"):
        ftp.storbinary("STOR /int/x.txt", io.BytesIO(b"x"))
    assert fetched(ftp, "/data/screen.tif"), "it goes on"
