"""Everything the paper shows, made again: tables, figures and a page that puts each beside its statement.

    make reproduce                              # 50 seeds
    python scripts/reproduce.py --quick         # 2 seeds, under two minutes: shows that it works
    python scripts/reproduce.py --only fig6     # one of them

Results over seeds are kept under OUT/cache while they come, so an interrupted run goes on where it
stopped. Exit status 1 where a claim leaves its stated tolerance.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from paper import (
    eq_ranging,
    fig4,
    fig5,
    fig6,
    page,
    points,
    samples,
    setups,
    spacing,
    table1,
)
from paper.run import Run, code_checksum

REPOSITORY = Path(__file__).resolve().parents[1]
PARTS = {
    "fig4": fig4, "fig5": fig5, "table1": table1, "fig6": fig6, "eq1-3": eq_ranging, "samples": samples,
    "points": points, "spacing": spacing, "setups": setups,
}  # fmt: skip


def main() -> int:
    """Make the parts asked for; the exit status."""
    arguments = _arguments()
    first, last = (int(part) for part in arguments.seeds.split(":"))
    seeds = range(2) if arguments.quick else range(first, last)
    run = Run(arguments.out, seeds, arguments.quick, arguments.workers, code_checksum())
    run.out.mkdir(parents=True, exist_ok=True)
    sections = []
    for name in arguments.only or PARTS:
        start = time.monotonic()
        sections.append(PARTS[name].make(run))
        print(f"{name}: {time.monotonic() - start:.0f} s", file=sys.stderr)
    command = " ".join(["python", "scripts/reproduce.py", *sys.argv[1:]])
    text = page.page(run, sections, command, time.strftime("%Y-%m-%d"))
    run.write("REPRODUCTION.md", text)
    print(f"page: {run.out / 'REPRODUCTION.md'}")
    broken = [c for section in sections for c in section.claims if c.holds is False]
    for claim in broken:
        print(
            f"claim does not hold: {claim.text}: {claim.here}, paper {claim.paper}, tolerance {claim.tolerance}"
        )
    return 1 if broken else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=REPOSITORY / "results" / "reproduction")
    parser.add_argument(
        "--quick", action="store_true", help="2 seeds; claims of statistics are not judged"
    )
    parser.add_argument("--seeds", default="500:550", help="first:last, the last one not included")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="PART", help=", ".join(PARTS))
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
