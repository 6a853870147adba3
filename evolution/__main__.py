"""Start the command `symbrion`, or report which extra is missing."""

import sys

from reconstruction._src.base.extras import MissingExtraError, require_extras


def main() -> None:
    """Run the command line and exit with its code; with 1 and a message where the extra `cli` is missing."""
    try:
        require_extras("the command `symbrion`", "cli")
    except MissingExtraError as error:
        sys.exit(f"symbrion: {error}")
    from evolution._src.cli.main import main as run_command_line

    run_command_line()


if __name__ == "__main__":
    main()
