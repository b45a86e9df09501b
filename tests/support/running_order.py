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
    "daemon/page/test_page_browser",
    "fitters/diagnosis/test_diagnosis",
    "drivers/agilent4294a/test_4294a_faults",
    "daemon/server/test_process_ends",
    "fitters/diagnosis/test_learning",
    "fitters/diagnosis/test_design",
    "fitters/diagnosis/test_other_models",
    "fitters/diagnosis/test_remarks",
    "fitters/diagnosis/test_learning_from_steps",
    "fitters/compare/test_compare",
    "daemon/journal/test_shared_journal",
    "daemon/server/test_hostile_messages",
    "fitters/compare/test_real_components",
    "daemon/cli/test_measure_diagnose",
    "test_packaging",
    "daemon/server/test_keys",
    "security/test_backup",
    "test_docs_examples",
    "models/disk2d/test_disk2d",
    "models/stack/test_stack_mpmath",
    "fitters/layered/test_stack2d_fitter",
    "system/walks/test_walks",
    "daemon/cli/test_compare",
    "security/test_operations",
    "fitters/population/test_joint_diagnosis",
    "fitters/compare/test_with_build",
    "daemon/server/test_worker_limits",
    "daemon/report/test_report_html",
    "models/disk2d/test_disk2d_built",
    "fitters/layered/test_several_piezos",
    "daemon/client/test_examples",
    "models/constants/test_causal",
    "drivers/agilent4294a/test_4294a_wire",
    "models/effects/test_effects",
    "fitters/compare/test_levels",
    "fitters/disk/test_disk2d_fitter",
    "sim/blind_cases/test_lab_world",
    "daemon/cli/test_real_recordings",
    "daemon/cli/test_prove",
    "models/stack/test_stack_properties",
    "daemon/cli/test_story",
    "daemon/cli/test_show_export_doctor",
    "daemon/cli/test_samples",
    "daemon/server/test_job_runner",
    "daemon/cli/test_user_effects",
    "fitters/diagnosis/test_search",
    "test_windows",
)
"""Modules whose tests take five seconds or more, longest first."""


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
