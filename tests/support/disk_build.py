"""The build of a bare disk in air."""

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.models.build import Build


def disk_build(diameter: float, thickness: float, density: float, material: str = "PZT-5A", more: str = "") -> Build:
    """Return the build of a disk, mm and kg/m3; `more`: further lines of its layer."""
    return parse_build(
        f"""
name = "D"
diameter_mm = {diameter}
[[layers]]
name = "disk"
kind = "piezo"
material = "{material}"
thickness_mm = {thickness}
density_kg_m3 = {density}
{more}
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
""",
        "build.toml",
    )
