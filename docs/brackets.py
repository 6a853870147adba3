"""Docstrings write units as `position [m] [source]`; Markdown would take two brackets for a link."""

import re

from griffe import Extension, Object


class EscapeBrackets(Extension):
    """Escape a closing bracket that another one follows, outside of code."""

    def on_object(self, *, obj: Object, **_: object) -> None:
        """Called by griffe for each object that it has loaded."""
        if obj.docstring:
            parts = re.split(r"(`[^`]*`)", obj.docstring.value)
            parts[::2] = [re.sub(r"\](?=\s?[\[(])", r"\\]", part) for part in parts[::2]]
            obj.docstring.value = "".join(parts)
