"""Start the command `symbrion`, or say which extra it lacks."""

import sys

from reconstruction.extras import MissingExtraError, require_extras


def main() -> None:
    """Run the command line and exit with its code; without the extra `cli`, say so and exit with 1."""
    try:
        require_extras("the command `symbrion`", "cli")
    except MissingExtraError as error:
        sys.exit(f"symbrion: {error}")
    from evolution.cli.main import main as run_command_line

    run_command_line()


if __name__ == "__main__":
    main()
