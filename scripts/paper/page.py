"""REPRODUCTION.md: each table and figure beside the paper's statement."""

from __future__ import annotations

from collections.abc import Sequence

from slam_uwb import __version__

from .run import Claim, Run, Section, markdown_table

_ASSUMPTIONS = """\
The paper's own recordings are not public. The figures below are of the same experiment **simulated** (scene
`paper-office`: three rooms on a corridor, 15 x 8 m, 18 stations, 7 anchors), and say nothing of the paper's
own office. Real scans by the same first author are in `kolakowski-flat`; what this software makes of them is
in the README.

What the simulator assumes:

- LiDAR: 500 Hz, 2 revolutions a second, noise 1.5 cm + 0.5 % of the range, steps of 1 cm, 1 % lost, people
  who pass.
- Ranges: 10 Hz shared by the anchors, 2.5 cm within a link, and a constant error of each link: 0.18 m common
  (antenna delays), 5 cm an anchor, 7 cm multipath, each wall crossed 0.40 m in the mean (gamma, near
  exponential), furniture 0.13 m; walls cost 7 dB, and links beyond 34 dB are not heard. From 36 real EVK1000
  links and 8 anchors of a hall (`slam_uwb/simulate/radio.py`); never tuned to a result.
- Tags: the same walls, multipath that changes over 0.5 m, anchors synchronised to 0.2 ns, Bluetooth powers
  with 3 dB shadowing and 4 dB fading; the filter's power law (exponent 3, sigma 8 dB) is an installer's
  guess, not the simulator's.
- The person walks straight legs between the tripod's places at 0.6 m/s, there and back.
- Anchors found are brought into the reference's frame by the stations (rigid, no scale).
"""


def page(run: Run, sections: Sequence[Section], command: str, date: str) -> str:
    """The page."""
    quick = (
        "**A quick run of few seeds: it shows that all of it works; its figures mean nothing.**\n\n"
        if run.quick
        else ""
    )
    seeds = f"seeds {run.seeds.start} to {run.seeds.stop - 1}"
    claims = [claim for section in sections for claim in section.claims]
    return (
        f"# The paper's experiments, reproduced\n\n{quick}"
        f"slam-uwb {__version__}, {date}, {seeds}: `{command}`\n\n"
        "M. Kolakowski, V. Djaja-Josko, J. Kolakowski, *Static LiDAR Assisted UWB Anchor Nodes Localization*,\n"
        "IEEE Sensors Journal, 2020.\n\n"
        + _ASSUMPTIONS
        + "\n## Claims\n\n"
        + markdown_table(
            ["claim", "paper", "here", "tolerance", "holds"], [_row(claim) for claim in claims]
        )
        + "".join(f"\n## {section.title}\n\n{section.text}" for section in sections)
    )


def _row(claim: Claim) -> list[str]:
    holds = {True: "yes", False: "**no**", None: "not judged"}[claim.holds]
    return [claim.text, claim.paper, claim.here, claim.tolerance, holds]
