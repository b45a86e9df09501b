"""The process that makes one backup, with a lower priority than the daemon."""

import argparse
import os
import sys
from contextlib import suppress
from pathlib import Path

from ....models.base.errors import PzctlError
from ...files.backup_plan import BackupPlan
from ...journal.backup.folder_target import back_up_to_folder
from ...journal.backup.rsync_target import back_up_by_rsync
from ...journal.backup.snapshot import snapshot
from .subprocesses import end_with_parent


def main() -> None:
    """Back up; the last line of the output gives the result or the reason of a failure."""
    parser = argparse.ArgumentParser()
    parser.add_argument("journal", type=Path)
    parser.add_argument("target")
    parser.add_argument("--again", action="store_true")
    given = parser.parse_args()
    end_with_parent()
    with suppress(AttributeError, OSError):
        os.nice(10)
    try:
        print(_backed_up(given.journal, BackupPlan(given.target), again=given.again))
    except PzctlError as error:
        sys.exit(str(error))
    except OSError as error:
        sys.exit(f"{error.filename or given.target}: {error.strerror or error}")


def _backed_up(journal: Path, plan: BackupPlan, *, again: bool) -> str:
    with snapshot(journal) as taken:
        if plan.is_remote:
            back_up_by_rsync(journal, taken, plan.to, again=again)
            beside = False
        else:
            back_up_to_folder(journal, taken, Path(plan.to), again=again)
            beside = Path(plan.to).stat().st_dev == journal.stat().st_dev
    warned = "; it is on the same disk as the journal, which it does not survive" if beside else ""
    return f"{taken.events} events and {len(taken.arrays)} recordings copied and read back{warned}"


if __name__ == "__main__":
    main()
