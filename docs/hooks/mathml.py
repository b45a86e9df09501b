"""For mkdocs: equations in `$$ ... $$` and `$ ... $` become MathML, which browsers draw without a script."""

import re
from typing import Any

from latex2mathml.converter import convert

_BLOCK = re.compile(r"^\$\$(.+?)\$\$$", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"(?<![\w$\\])\$([^$\n]+?)\$(?![\w$])")
_CODE = re.compile(r"(^```.*?^```|`[^`\n]+`)", re.MULTILINE | re.DOTALL)
_PLACE = re.compile(r"MATHML(\d+)X")


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return a page with a placeholder for each equation, so that Markdown does not change them; code is kept."""
    made: list[str] = page.meta.setdefault("mathml", [])

    def kept(tex: str, display: str) -> str:
        made.append(convert(" ".join(tex.split()), display=display))
        return f"MATHML{len(made) - 1}X"

    def replaced(text: str) -> str:
        text = _BLOCK.sub(lambda found: kept(found[1], "block"), text)
        return _INLINE.sub(lambda found: kept(found[1], "inline"), text)

    parts = _CODE.split(markdown)
    return "".join(part if k % 2 else replaced(part) for k, part in enumerate(parts))


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """Return the page with the equations in their places."""
    return _PLACE.sub(lambda found: page.meta["mathml"][int(found[1])], html)
