"""What `import pzctl` offers: every name is listed, exists, is documented, and takes a path as text."""

import os
from pathlib import Path

import pzctl
from pzctl.daemon.files.builds.build_file import THESIS_BUILD


def test_every_public_name_is_listed_and_documented() -> None:
    assert dir(pzctl) == sorted(pzctl.__all__)
    assert {"connect", "read", "fit", "diagnose", "compare", "read_build", "Stack"} <= set(dir(pzctl))
    for name in pzctl.__all__:
        assert getattr(pzctl, name).__doc__, name


def test_a_path_may_be_text() -> None:
    build = pzctl.read_build(os.fspath(THESIS_BUILD))
    assert build == pzctl.read_build(Path(THESIS_BUILD))
    assert pzctl.model(os.fspath(THESIS_BUILD), "disk") == pzctl.model(build, "disk")
