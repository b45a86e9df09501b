"""Every fault at every exchange of a measurement: the table of outcomes (`make bench`; some minutes)."""

import runpy
from collections import Counter
from pathlib import Path

import pytest

from pzctl.sim.server import SimOptions, running

faults = runpy.run_path(str(Path(__file__).parents[1] / "drivers" / "agilent4294a" / "test_4294a_faults.py"))


@pytest.mark.timeout(2400)
@pytest.mark.parametrize("plan", [faults["PLAN"], faults["JOINED"]], ids=["plain", "list"])
def test_every_fault_at_every_exchange(plan):
    table, slowest = {}, Counter()
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, noise=False)) as sim:
        clean = faults["attempt"](sim, plan=plan)
        assert clean.impedance is not None
        for kind in faults["KINDS"]:
            outcomes = Counter()
            for at in range(1, clean.exchanges + 1):
                outcome = faults["attempt"](sim, kind, at, plan)
                faults["check"](outcome, clean.impedance, kind, at)
                sound = "sweep, correct" if outcome.impedance is not None else "clear error"
                said = ", not left as found (said)" if "Besides: " in outcome.error else ""
                outcomes[sound + said if outcome.struck else "fault did not strike"] += 1
                slowest[kind] = max(slowest[kind], outcome.seconds)
            table[kind] = outcomes
    answer = faults["SILENT_SECONDS"]
    print(f"\n{clean.exchanges} exchanges in a measurement; a single answer may take {answer} s")
    for kind, outcomes in table.items():
        counts = "; ".join(f"{count} {what}" for what, count in sorted(outcomes.items()))
        print(f"{kind:12} {counts}; longest {slowest[kind]:.2f} s")
