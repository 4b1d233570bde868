"""docs/performance.md from the figures of one run: python benchmarks/page.py RESULTS.json PAGE.md."""

from __future__ import annotations

import json
import math
import platform
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import mean
from typing import Any

from stages import MEASURED

from slam_uwb import __version__

Bench = dict[str, Any]
COMMAND = (
    '`make bench` writes this page; `make bench ARGS="--sizes 18,90,300,1000 --batch 40"` measures '
    "all sizes."
)
SIZES = (
    "Sizes are stations: 18 are the scene `paper-office`, others random floors. Recordings last a minute at "
    "500 Hz up to 90 stations, ten seconds in larger ones. A stage is measured in one process; the whole is "
    "`slam-uwb solve --workers 2`, folder to solution with figure and report."
)
LIMITS_S = {18: 5.0, 90: 35.0, 300: 150.0, 1000: 600.0}
LIMIT_SMALL_MB, LIMIT_LARGE_MB, LIMIT_EXPONENT = 500.0, 3000.0, 1.3
LIMIT_BATCH, LIMIT_JOINT, LIMIT_MAP_S, LIMIT_HELP_S = 0.6, 3.0, 10.0, 0.25
GRAPH_STATIONS = 10_000


def main() -> None:
    """Write the page."""
    results, page = map(Path, sys.argv[1:])
    run = json.loads(results.read_text())
    benches = [bench["extra_info"] | {"s": bench["stats"]["median"]} for bench in run["benchmarks"]]
    page.write_text(_page(run, benches))
    print(page)


def _page(run: dict[str, Any], benches: list[Bench]) -> str:
    loads = [bench["load"][0] for bench in benches]
    cpu = run["machine_info"].get("cpu", {}).get("brand_raw", platform.machine())
    measured = (
        f"slam-uwb {__version__}, {run['datetime'][:10]}, {cpu}, {run['machine_info']['cpu'].get('count', '?')} "
        f"processors, Python {platform.python_version()}. Load average while measuring: {min(loads):.1f} to "
        f"{max(loads):.1f}, of which up to 2 is the measuring itself: **with more, times are too long; ratios "
        "within the run hold.**"
    )
    parts = [
        "# Performance",
        COMMAND,
        measured,
        SIZES,
        "## Against what it must show\n\n" + _claims(benches),
        "## Stages\n\n" + _stages(benches),
        "## Ratios within the run\n\n" + _ratios(benches),
        "## The joint solve on drawn graphs\n\n" + _graphs(benches),
        "## Where the time goes\n\n" + _profiles(benches),
    ]
    return "\n\n".join(part.rstrip("\n") for part in parts) + "\n"


def _claims(benches: list[Bench]) -> str:
    rows = []
    wholes = _by_size(b for b in benches if b.get("whole"))
    for size, bench in wholes.items():
        memory = LIMIT_SMALL_MB if size == 18 else LIMIT_LARGE_MB
        rows += [
            _claim(f"{bench['stations']} stations, whole", f"{bench['s']:.1f} s", bench["s"],
                   LIMITS_S[size], f"{LIMITS_S[size]:g} s"),
            _claim(f"{bench['stations']} stations, peak memory (PSS)", f"{bench['peak_mb']:.0f} MB",
                   bench["peak_mb"], memory, f"{memory:g} MB"),
        ]  # fmt: skip
    if len(wholes) > 1:
        grown = _exponent(wholes.values())
        rows.append(_claim("growth exponent of the whole", f"{grown:.2f}", grown, LIMIT_EXPONENT,
                           f"{LIMIT_EXPONENT}"))  # fmt: skip
    for bench in benches:
        rows += _single_claims(bench)
    for ours, batch in _graph_pairs(benches):
        ratio = ours["s"] / batch["s"]
        what = f"joint solve of {ours['stations']} drawn stations, times GTSAM's batch"
        asked = LIMIT_JOINT if ours["stations"] == GRAPH_STATIONS else math.inf
        rows.append(
            _claim(what, f"{ratio:.1f}", ratio, asked, f"{LIMIT_JOINT:g} at {GRAPH_STATIONS}")
        )
    return _table(["", "measured", "at most", "holds"], rows)


def _single_claims(bench: Bench) -> list[list[str]]:
    if bench.get("program") == "help":
        return [_claim("`slam-uwb --help`", f"{bench['s']:.2f} s", bench["s"], LIMIT_HELP_S,
                       f"{LIMIT_HELP_S} s")]  # fmt: skip
    if bench.get("program") == "batch":
        ratio = bench["s"] / bench["single_s"]
        what = f"batch of {bench['count']} `flat`, {bench['workers']} workers, to the sum of single solves"
        return [_claim(what, f"{ratio:.2f} ({bench['peak_mb']:.0f} MB)", ratio, LIMIT_BATCH,
                       f"{LIMIT_BATCH}")]  # fmt: skip
    if bench.get("stage") == "map" and bench["size"] == 1000:
        return [_claim("map of 1,000 stations", f"{bench['s']:.1f} s", bench["s"], LIMIT_MAP_S,
                       f"{LIMIT_MAP_S:g} s")]  # fmt: skip
    return []


def _stages(benches: list[Bench]) -> str:
    sizes = sorted({b["size"] for b in benches if "stage" in b})
    counts = {b["size"]: b["stations"] for b in benches if "stage" in b}
    rows = []
    for stage in MEASURED:
        found = _by_size(b for b in benches if b.get("stage") == stage)
        cells = [f"{found[size]['s']:.2f} s" if size in found else "" for size in sizes]
        grown = f"{_exponent(found.values()):.2f}" if len(found) > 1 else ""
        rows.append([stage, *cells, grown])
    return _table(
        ["", *(f"{counts[size]} stations" for size in sizes), "growth exponent"], rows
    ) + ("\nThe exponent is that of a power of the number of stations.\n")


def _ratios(benches: list[Bench]) -> str:
    stages = {(b["stage"], b["size"]): b for b in benches if "stage" in b}
    rows = []
    for bench in benches:
        stage = stages.get((bench.get("reference"), bench.get("size")))
        if stage is not None:
            alone = bench["s"] / bench.get("share", 1.0)
            rows.append([
                f"{bench['stations']} stations: {stage['stage']}", f"{stage['s']:.2f} s", bench["what"],
                f"{alone:.3f} s", f"{stage['s'] / alone:.1f}",
            ])  # fmt: skip
    return _table(["", "", "to", "", "ratio"], rows)


def _graphs(benches: list[Bench]) -> str:
    rows = []
    for ours, batch in _graph_pairs(benches):
        counts = [f"{ours[kind]} {kind}" for kind in ("stations", "anchors", "matches", "links")]
        times = [f"{ours['s']:.2f} s, {ours['passes']} passes", f"{batch['s']:.2f} s"]
        ratio = f"{ours['s'] / batch['s']:.1f}"
        rows.append([", ".join(counts), *times, ratio, f"{ours['gap_mm']:.4f} mm"])
    text = (
        "From a start within 0.2 m and 2 degrees, Gaussian ranges without delays; GTSAM's batch "
        "Levenberg-Marquardt works on its own C++ factors of the same measurements.\n\n"
    )
    return text + _table(["", "passes", "batch", "ratio", "apart"], rows)


def _profiles(benches: list[Bench]) -> str:
    texts = ["Own time of functions, as a share of `solve_survey` under cProfile.\n"]
    for bench in _by_size(b for b in benches if b.get("whole")).values():
        rows = [
            [name, f"{calls}", f"{100 * share:.1f} %"] for name, calls, share in bench["profile"]
        ]
        texts.append(_table([f"{bench['stations']} stations", "calls", "share"], rows))
    return "\n".join(texts)


def _graph_pairs(benches: list[Bench]) -> list[tuple[Bench, Bench]]:
    batch = {b["stations"]: b for b in benches if b.get("graph") == "batch"}
    ours = [b for b in benches if b.get("graph") == "ours" and b["stations"] in batch]
    return [(b, batch[b["stations"]]) for b in ours]


def _by_size(benches: Iterable[Bench]) -> dict[int, Bench]:
    return {b["size"]: b for b in sorted(benches, key=lambda b: int(b["size"]))}


def _exponent(benches: Iterable[Bench]) -> float:
    """Slope of log time over log stations, by least squares."""
    points = [(math.log(b["stations"]), math.log(b["s"])) for b in benches]
    mx, my = (mean(column) for column in zip(*points, strict=True))
    return sum((x - mx) * (y - my) for x, y in points) / sum((x - mx) ** 2 for x, _ in points)


def _claim(what: str, shown: str, value: float, limit: float, asked: str) -> list[str]:
    holds = "not judged" if math.isinf(limit) else "yes" if value <= limit else "**no**"
    return [what, shown, asked, holds]


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    main()
