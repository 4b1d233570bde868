"""The joint solver's passes against GTSAM's batch optimiser on the same drawn graph."""

from __future__ import annotations

from typing import Any

import pytest
from joint_graph import draw_graph, gap_m, solve_batch, solve_ours

SIZES = (300, 1000, 3000, 10_000)


@pytest.fixture(params=SIZES)
def drawn(request: pytest.FixtureRequest) -> Any:
    """200 stations and 1,200 links an anchor."""
    if request.param > request.config.getoption("--graph"):
        pytest.skip(f"larger than --graph {request.config.getoption('--graph')}")
    return draw_graph(request.param, max(8, request.param // 200), 6 * request.param)


def bench_joint_graph(benchmark: Any, drawn: Any) -> None:
    found, passes = benchmark.pedantic(solve_ours, args=(drawn,), rounds=3)
    gap = gap_m(found, solve_batch(drawn))
    assert gap < 0.001
    benchmark.extra_info.update(
        graph="ours", stations=len(drawn.truth.poses), anchors=len(drawn.truth.anchors),
        links=len(drawn.links), matches=len(drawn.matches), passes=passes, gap_mm=1e3 * gap,
    )  # fmt: skip


def bench_batch_graph(benchmark: Any, drawn: Any) -> None:
    benchmark.pedantic(solve_batch, args=(drawn,), rounds=3)
    benchmark.extra_info.update(graph="batch", stations=len(drawn.truth.poses))
