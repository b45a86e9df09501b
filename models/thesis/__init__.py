"""The thesis this work goes on from, its tables rebuilt and its errors proved.

`page()` returns `docs/thesis.md`. To write it:
`python -P -c "from pzctl.models.thesis import page; print(page(), end='')" > docs/thesis.md`.
"""

from .page import page

__all__ = ["page"]
