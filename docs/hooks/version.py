"""For mkdocs: the site says of which version it is."""

import tomllib
from pathlib import Path
from typing import Any


def on_config(config: Any) -> Any:
    """Write the version of pyproject.toml behind the name of the site."""
    project = tomllib.loads((Path(config.config_file_path).parent / "pyproject.toml").read_text(encoding="utf-8"))
    config.site_name = f"{config.site_name} {project['project']['version']}"
    return config
