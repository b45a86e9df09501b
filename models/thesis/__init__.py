"""The thesis that this project started from, its tables recomputed and its errors shown.

`page()` returns `docs/thesis.md`. To write it:
`python -P -c "from pzctl.models.thesis import page; print(page(), end='')" > docs/thesis.md`.
"""

from .page import page

__all__ = ["page"]
