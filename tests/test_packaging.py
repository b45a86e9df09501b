"""The repository root is the package, and every way of installing it installs exactly its content."""

import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("daemon", "drivers", "fitters", "models", "sim")


def test_every_package_is_shipped() -> None:
    listed = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"])
    found = {
        "pzctl." + ".".join(p.parent.relative_to(ROOT).parts)
        for top in ROOMS
        for p in (ROOT / top).rglob("__init__.py")
    }
    assert found <= listed, f"add to [tool.setuptools] packages: {sorted(found - listed)}"


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with wheel and sdist, built from the tracked files in a folder of another name."""
    source = tmp_path_factory.mktemp("my-clone")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("not a git checkout, so the project's files are not known")
    for name in listed.stdout.splitlines():
        if (ROOT / name).exists():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, source / name)
    built = subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", source / "dist", source],
        capture_output=True,
        text=True,
        check=False,
        cwd=source,
    )
    assert built.returncode == 0, built.stderr[-2000:]
    return source / "dist"


def test_the_wheel_holds_the_code_and_one_name(dist: Path) -> None:
    with zipfile.ZipFile(next(dist.glob("*.whl"))) as wheel:
        names = wheel.namelist()
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"pzctl"}
    assert "pzctl/py.typed" in names
    assert "pzctl/daemon/files/builds/thesis.toml" in names
    assert any(name.endswith("entry_points.txt") for name in names)
    assert not [name for name in names if "/tests/" in name or "/docs/" in name or name.endswith("README.md")]


def test_the_sdist_holds_the_tests(dist: Path) -> None:
    with tarfile.open(next(dist.glob("*.tar.gz"))) as sdist:
        names = [name.partition("/")[2] for name in sdist.getnames()]
    assert "tests/test_packaging.py" in names
    assert "models/stack/stack.py" in names


def test_the_installed_wheel_runs(dist: Path, tmp_path: Path) -> None:
    """Installed from the wheel only, away from the checkout: fitters load, and their data files are installed."""
    wheel = next(dist.glob("*.whl"))
    target = tmp_path / "site"
    how = ["--quiet", "--no-deps", "--no-index", "--no-compile"]
    subprocess.run([sys.executable, "-m", "pip", "install", *how, "--target", target, wheel], check=True)
    program = (
        "import pzctl, sys; assert pzctl.__file__.startswith(sys.argv[1]), pzctl.__file__\n"
        "from pzctl.fitters.plugins import list_fitters; assert all(fitter.works for fitter in list_fitters())\n"
        "from pzctl.daemon.files.builds.build_file import read_build; from pathlib import Path\n"
        "read_build(Path(pzctl.__file__).parent / 'daemon' / 'files' / 'builds' / 'thesis.toml')\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(target)}
    done = subprocess.run(
        [sys.executable, "-c", program, str(target)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr


def test_modules_exist_once() -> None:
    """In the checkout, nothing imports the package under the folder's own name."""
    import pzctl.models.stack

    where = pzctl.models.stack.__file__
    assert [name for name, module in sys.modules.items() if getattr(module, "__file__", None) == where] == [
        "pzctl.models.stack"
    ]


def test_the_command_line_starts_without_numerical_libraries() -> None:
    """They would take twice as long to load as all else, and would use all cores before `main` limits them to one."""
    program = "import sys, pzctl.daemon.cli; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
