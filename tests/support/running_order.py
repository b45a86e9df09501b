"""The order in which tests run: those that take longest begin first, in every process of a parallel run.

`pytest -n 4 --dist worksteal` gives each of its processes a contiguous share of the tests. A process that has ended its
own share takes over the end of another's. So if each share begins with its longest tests, only short ones are left at
the end, and all processes end at nearly the same time.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar

_Item = TypeVar("_Item")

LONGEST = (
    "test_docs",
    "fitters/diagnosis/test_diagnosis",
    "fitters/compare/test_compare",
    "daemon/cli/test_measure_diagnose",
    "fitters/diagnosis/test_learning",
    "fitters/diagnosis/test_remarks",
    "daemon/page/test_page_browser",
    "system/walks/test_walks",
    "fitters/population/test_joint_diagnosis",
    "fitters/diagnosis/test_other_models",
    "daemon/cli/test_compare",
    "models/disk2d/test_disk2d_built",
    "fitters/layered/test_several_piezos",
    "fitters/diagnosis/test_design",
    "models/disk2d/test_disk2d",
    "daemon/report/test_report_html",
    "test_docs_examples",
    "fitters/compare/test_real_components",
    "fitters/layered/test_stack2d_fitter",
    "fitters/compare/test_levels",
    "daemon/server/test_process_ends",
    "models/effects/test_effects",
    "daemon/cli/test_user_effects",
    "sim/blind_cases/test_lab_world",
    "daemon/server/test_hostile_messages",
    "fitters/disk/test_disk2d_fitter",
    "drivers/agilent4294a/test_4294a_faults",
    "drivers/recordings/test_recordings_read",
    "daemon/cli/test_story",
    "daemon/server/test_job_runner",
    "test_packaging",
    "models/stack/test_stack_mpmath",
    "security/test_operations",
    "models/stack2d/test_stack2d",
    "daemon/journal/test_shared_journal",
    "models/stack/test_stack_properties",
    "fitters/compare/test_with_build",
    "security/test_limits",
    "daemon/cli/test_prove",
    "test_windows",
)
"""Modules whose tests take four seconds of processor time or more, longest first."""


def in_shares(items: Sequence[_Item], shares: int, module_of: Callable[[_Item], str]) -> list[_Item]:
    """Return the items so that each of so many equal shares, one after the other, begins with its longest.

    The items of one of the longest modules stay together, because they often share fixtures; the modules are dealt out.
    """
    by_module: dict[str, list[_Item]] = {name: [] for name in LONGEST}
    others: list[_Item] = []
    for item in items:
        by_module.get(module_of(item), others).append(item)
    longest = [by_module[name] for name in LONGEST if by_module[name]]
    ordered: list[_Item] = []
    for share in range(shares):
        own = [item for module in longest[share::shares] for item in module]
        size = (len(items) - len(ordered)) // (shares - share)
        filled = max(0, size - len(own))
        ordered += own + others[:filled]
        others = others[filled:]
    return ordered + others
