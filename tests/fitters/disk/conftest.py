"""Fixtures for disks."""

import os

import pytest


@pytest.fixture(scope="module")
def own_cache(tmp_path_factory):
    """Keep reduced disks in a folder of the module's own."""
    before = os.environ.get("PZCTL_HOME")
    os.environ["PZCTL_HOME"] = str(tmp_path_factory.mktemp("home"))
    yield
    if before is None:
        del os.environ["PZCTL_HOME"]
    else:
        os.environ["PZCTL_HOME"] = before
