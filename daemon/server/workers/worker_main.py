"""Start and end of a worker's process: it has memory limits, ends with its parent, and reports an error in one line."""

import argparse
import logging
import sys
from collections.abc import Callable

from ....fitters.plugins import PluginError
from ....models.base.errors import PzctlError
from ...client.client import Client
from ...files.worker_limits import Limits, limit_memory
from .process_runner import worker_client
from .subprocesses import end_with_parent

GIVEN_UP = 2
"""The exit status after which a restart is of no use."""


def run_worker(parser: argparse.ArgumentParser, work: Callable[[Client, argparse.Namespace], None]) -> None:
    """Run `work` as a client of the daemon that started this process; end when the daemon ends."""
    parser.add_argument("--events", required=True)
    parser.add_argument("--requests", required=True)
    parser.add_argument("--memory-MB", type=int, default=Limits.memory_MB, help="address space it may use")
    given = parser.parse_args()
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", level=logging.INFO)
    end_with_parent()
    limit_memory(given.memory_MB)
    try:
        with worker_client(given.events, given.requests) as client:
            work(client, given)
    except PluginError as error:
        logging.exception("fitter")
        print(error, file=sys.stderr)
        sys.exit(GIVEN_UP)
    except PzctlError as error:
        print(error, file=sys.stderr)
        sys.exit(1)
    except MemoryError:
        print(f"it needs more than the allowed {given.memory_MB} MB of memory", file=sys.stderr)
        sys.exit(1)
