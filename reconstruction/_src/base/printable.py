"""Text from outside (names, paths, file contents) made printable on one line of a terminal or a file."""


def make_printable(text: object, limit: int = 2000) -> str:
    r"""Return text without control characters and lone surrogates: they are escaped, `\x1b` say."""
    shown = str(text)
    if len(shown) > limit:
        shown = f"{shown[:limit]}..."
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in shown)
