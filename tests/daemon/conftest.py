"""A daemon in a process of its own, for each test that asks for one."""

from daemon_fixtures import build, end, start_daemon, wait_until

__all__ = ["build", "end", "start_daemon", "wait_until"]
