"""A daemon in its own process, for each test that requests one."""

from daemon_fixtures import build, end, start_daemon, wait_until

__all__ = ["build", "end", "start_daemon", "wait_until"]
