"""The order in which tests run: those that take longest begin first, in every process of a parallel run.

`pytest -n 4 --dist worksteal` gives each of its processes a contiguous share of the tests. A process that has ended its
own share takes over the end of another's. So if each share begins with its longest tests, only short ones are left at
the end, and all processes end at nearly the same time.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar

_Item = TypeVar("_Item")

LONGEST = (
    "fitters/diagnosis/test_diagnosis",
    "test_docs",
    "daemon/page/test_page_browser",
    "system/walks/test_walks",
    "fitters/diagnosis/test_learning",
    "fitters/compare/test_compare",
    "daemon/cli/test_measure_diagnose",
    "fitters/error_model/test_error_model",
    "fitters/population/test_joint_diagnosis",
    "fitters/diagnosis/test_remarks",
    "test_docs_examples",
    "fitters/layered/test_stack2d_fitter",
    "fitters/layered/test_several_piezos",
    "models/disk2d/test_disk2d",
    "daemon/cli/test_story",
    "daemon/report/test_report_html",
    "fitters/compare/test_real_components",
    "models/disk2d/test_disk2d_built",
    "fitters/disk/test_disk2d_fitter",
    "fitters/diagnosis/test_other_models",
    "daemon/report/test_analysis",
    "daemon/server/test_process_ends",
    "models/disk2d/test_dots",
    "daemon/server/test_resets",
    "daemon/cli/test_compare",
    "fitters/engine/test_swapped_steps",
    "fitters/diagnosis/test_condensed_recordings",
    "models/stack/test_stack_mpmath",
    "daemon/server/test_hostile_messages",
    "sim/blind_cases/test_lab_world",
    "fitters/compare/test_with_build",
    "fitters/engine/test_estimation",
    "fitters/engine/test_known_effects",
    "models/stack2d/test_stack2d",
    "fitters/diagnosis/test_search",
    "daemon/cli/test_prove",
    "fitters/engine/test_plausibility",
    "test_packaging",
    "daemon/page/test_page_server",
    "fitters/layered/test_mason",
    "security/test_operations",
    "fitters/diagnosis/test_data_quality",
    "fitters/layered/test_bvd",
    "fitters/population/test_batch",
    "drivers/recordings/test_recordings_read",
    "fitters/diagnosis/test_design",
    "daemon/samples/test_journal_manual_fit",
    "daemon/cli/test_show_export_doctor",
    "models/effects/test_effects",
    "fitters/error_model/test_joint_descent",
    "test_windows",
    "models/stack/test_stack_properties",
    "daemon/journal/test_shared_journal",
    "models/effects/test_effects_physics",
    "daemon/report/test_unbroken_tables",
    "daemon/server/test_example_analyzer",
    "fitters/diagnosis/test_hypotheses",
    "daemon/cli/test_user_effects",
    "security/test_limits",
    "daemon/client/test_examples",
    "daemon/cli/test_notes",
    "fitters/diagnosis/test_colour_limit",
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
