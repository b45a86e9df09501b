"""Processor time of the commands a person waits for, and its ratio to an earlier commit, both measured in one run.

python tests/benchmarks/felt_speed.py COMMIT
"""

import resource
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RUN = "from pzctl.daemon.cli import main; main()"
FIT = "fit --build thesis.toml disk=data/thesis-disk-1.csv disk=data/thesis-disk-2.csv"
COMMANDS = {
    "help": ("--help", 0.2),
    "fit without picture": (f"{FIT} --json", 0.7),
    "fit with picture": (FIT, 1.5),
    "report": ("report thesis --out thesis.html", 3.0),
}
"""Command and goal in seconds of processor time; files in the disk cache."""
REPEATS = 5


def seconds(package: Path, words: str, folder: Path) -> float:
    """Return the least processor time of several runs of a command, s, by the `pzctl` in a folder of packages."""
    times: list[float] = []
    for _ in range(REPEATS):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        run(package, words, folder)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times)


def run(package: Path, words: str, folder: Path) -> None:
    """Run a command with its own data folder, which each version of pzctl keeps for itself."""
    environment = {"PZCTL_HOME": str(folder / f"home-{package.name}"), "OPENBLAS_NUM_THREADS": "1", "PATH": "/usr/bin"}
    environment["PYTHONPATH"] = str(package)
    done = subprocess.run(
        [sys.executable, "-c", RUN, *words.split()],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        sys.exit(f"{words}: {done.stderr}")


def describe(package: Path) -> None:
    """Write the metadata of an installed package beside a folder's `pzctl`, by which its plug-ins are found."""
    project = tomllib.loads((package / "pzctl" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = package / f"pzctl-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: pzctl\nVersion: {project['version']}\n")
    groups = {"console_scripts": project["scripts"], **project["entry-points"]}
    lines = [
        line for group, names in groups.items() for line in (f"[{group}]", *(f"{k} = {v}" for k, v in names.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


def measured(packages: Mapping[str, Path], folder: Path) -> dict[str, dict[str, float]]:
    """Return the seconds of each command, by version."""
    (folder / "thesis.toml").write_bytes((ROOT / "daemon" / "files" / "builds" / "thesis.toml").read_bytes())
    for package in packages.values():
        describe(package)
        run(package, "measure --step disk --fit --time-scale 0", folder)
        run(package, "export thesis --to data", folder)
    return {
        name: {version: seconds(package, words, folder) for version, package in packages.items()}
        for name, (words, _) in COMMANDS.items()
    }


def main(commit: str) -> None:
    """Print a table in Markdown."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        packages = {"now": folder / "now", commit: folder / "then"}
        for package in packages.values():
            package.mkdir()
        (packages["now"] / "pzctl").symlink_to(ROOT)
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--detach", str(packages[commit] / "pzctl"), commit], check=True)
        try:
            times = measured(packages, folder)
        finally:
            subprocess.run([*git, "remove", "--force", str(packages[commit] / "pzctl")], check=True)
    print(f"| command | goal, s | now, s | {commit}, s | ratio |\n|---|---|---|---|---|")
    for command, by_version in times.items():
        now, then = by_version["now"], by_version[commit]
        print(f"| {command} | {COMMANDS[command][1]} | {now:.2f} | {then:.2f} | {now / then:.2f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
