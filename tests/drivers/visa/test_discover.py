"""The search for instruments of `pzctl doctor`: what it found, which instruments answered, what it skipped."""

import importlib.util

from pzctl.drivers.visa import discover
from pzctl.sim.server import SimOptions, running


def test_the_search_reports_what_it_skipped():
    result = discover.discover(list_seconds=30)
    assert any("HOST:5025" in what for what in result.not_scanned)
    assert all("Traceback" not in what and "\n" not in what for what in result.not_scanned)
    said = "; ".join(result.not_scanned)
    for module, remedy in discover.MISSING.items():
        assert (remedy in said) == (importlib.util.find_spec(module) is None)


def test_a_hanging_child_is_ended_and_reported():
    answer = discover._in_child("import time; time.sleep(60)", [], 1.0)
    assert "no answer within 1 s" in answer["error"]


def test_who_answers_is_asked_in_a_child():
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0)) as sim:
        found = discover._identified(sim.resource, 5.0)
    assert found.idn == "HEWLETT-PACKARD,4294A,MY43202956,REV1.11"
    assert "nothing listens there" in discover._identified(sim.resource, 5.0).says
    assert discover._identified("ASRL1::INSTR", 5.0).says.startswith("skipped")
