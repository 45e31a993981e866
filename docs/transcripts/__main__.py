"""``python3 do.py docs --compare`` and ``--write``: run the commands of pages, and see what they print."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from transcripts.pages import EXACTLY, OTHER_CPU, every_page, outcomes


def main(arguments: list[str]) -> int:
    """0: every page says what is printed, or does so now; 1: one does not."""
    parser = argparse.ArgumentParser(prog="python3 do.py docs", description=__doc__)
    parser.add_argument("pages", nargs="*", type=Path, help="Default: README.md and docs/*.md")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--compare", action="store_true", help="tell where a page says something else")
    what.add_argument("--write", action="store_true", help="write into the pages what was printed")
    parser.add_argument("--without", help="do not run commands in which this regular expression is found")
    given = parser.parse_args(arguments)
    pages = [page.resolve() for page in given.pages] or every_page()
    left = 0
    tolerance = EXACTLY if given.write else OTHER_CPU
    for together in outcomes(pages, tolerance, leave_out=given.without, tell=_tell):
        differences = [each for outcome in together for each in outcome.differences]
        if given.write and differences:
            for outcome in together:
                outcome.write()
            differences = [each for each in differences if each.needs_a_person]
            print(f"Written: {', '.join(outcome.page.path.name for outcome in together)}", flush=True)
        left += len(differences)
        for difference in differences:
            print(difference, flush=True)
    if not left:
        print("Every page says what its commands print.")
    return min(left, 1)


def _tell(sentence: str) -> None:
    print(sentence, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
