"""How a guest's process begins and ends: with its parent, in its limits, and with one sentence of what went wrong."""

import argparse
import logging
import sys
from collections.abc import Callable

from ....fitters.plugins import PluginError
from ....models.base.errors import PzctlError
from ...client.client import Client
from ...files.worker_limits import Limits, limit_memory
from .process_runner import guest_client
from .subprocesses import end_with_parent

GIVEN_UP = 2
"""The exit status that says: starting me again is of no use."""


def run_as_guest(parser: argparse.ArgumentParser, work: Callable[[Client, argparse.Namespace], None]) -> None:
    """Do some work as a client of the daemon that started this process, and end with it."""
    parser.add_argument("--events", required=True)
    parser.add_argument("--requests", required=True)
    parser.add_argument("--memory-MB", type=int, default=Limits.memory_MB, help="address space it may use")
    given = parser.parse_args()
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", level=logging.INFO)
    end_with_parent()
    limit_memory(given.memory_MB)
    try:
        with guest_client(given.events, given.requests) as client:
            work(client, given)
    except PluginError as error:
        logging.exception("fitter")
        print(error, file=sys.stderr)
        sys.exit(GIVEN_UP)
    except PzctlError as error:
        print(error, file=sys.stderr)
        sys.exit(1)
    except MemoryError:
        print(f"it needs more than the {given.memory_MB} MB of memory it may use", file=sys.stderr)
        sys.exit(1)
