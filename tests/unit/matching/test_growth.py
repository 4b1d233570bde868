from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from slam_uwb.matching.evidence import Block
from slam_uwb.matching.growth import all_apart
from slam_uwb.matching.merging import Merge


def joined(*pairs):
    """Hypotheses between these stations, as far as their ends go."""
    return [SimpleNamespace(target=a, source=b) for a, b in pairs]


def linked(weights, asked=None):
    """Merge with the weight of the best link between two blocks; None where that is not positive."""

    def best(a, b, *, apart=0.0):
        if asked is not None:
            asked.append((frozenset(a.poses), frozenset(b.poses)))
        weight = max(weights.get(frozenset({i, j}), 0.0) for i in a.poses for j in b.poses)
        return Merge(np.zeros(3), weight, weight) if weight > 0.0 else None

    return best


def grown(growth, best):
    """Priorities of all merges in turn."""
    growth.ask_again()
    priorities = []
    while (found := growth.next_merge(best)) is not None:
        pair, merge = found
        a, b = (growth.blocks[part] for part in pair)
        growth.replace(
            pair, Block({**a.poses, **b.poses}, {**a.seen, **b.seen}, a.sights + b.sights)
        )
        priorities.append(merge.priority)
    return priorities


@pytest.mark.parametrize("seed", range(5))
def test_the_best_merge_comes_first(three_room_scans, seed):
    """The best link between two groups first, again and again: Kruskal's maximum spanning tree."""
    rng = np.random.default_rng(seed)
    pairs = list(combinations(three_room_scans, 2))
    weights = {
        frozenset(pair): float(weight)
        for pair, weight in zip(pairs, rng.random(len(pairs)), strict=True)
    }
    group = {station: {station} for station in three_room_scans}
    expected = []
    for a, b in sorted(pairs, key=lambda pair: -weights[frozenset(pair)]):
        if group[a] is not group[b]:
            expected.append(weights[frozenset((a, b))])
            group[a] |= group[b]
            group.update(dict.fromkeys(group[b], group[a]))
    growth = all_apart(three_room_scans, joined(*pairs))
    assert grown(growth, linked(weights)) == expected
    assert len(growth.blocks) == 1


def test_a_pair_is_looked_at_again_only_when_it_may_come_first(three_room_scans):
    """s1-s2 (5) merge before s1-s3 (3) and s2-s3 (1); the grown block and s3 are looked at once."""
    names = [*three_room_scans][:3]
    scans = {name: three_room_scans[name] for name in names}
    pairs = list(combinations(names, 2))
    weights = dict(zip(map(frozenset, pairs), (5.0, 3.0, 1.0), strict=True))
    asked = []
    assert grown(all_apart(scans, joined(*pairs)), linked(weights, asked)) == [5.0, 3.0]
    assert len(asked) == len(pairs) + 1


def test_what_no_hypothesis_joins_is_never_asked(three_room_scans):
    s1, s2, s3, s4, *_ = three_room_scans
    weights = {frozenset(pair): 1.0 for pair in combinations(three_room_scans, 2)}
    growth = all_apart(three_room_scans, joined((s1, s2), (s3, s4), (s4, s3)))
    assert grown(growth, linked(weights)) == [1.0, 1.0]
    assert sorted(len(block.poses) for block in growth.blocks.values()) == [1, 1, 1, 2, 2]


def test_blocks_merged_from_outside_are_asked_again(three_room_scans):
    """A pair that could not be merged may be, once somebody has merged another."""
    s1, s2, s3, *_ = three_room_scans
    scans = {name: three_room_scans[name] for name in (s1, s2, s3)}
    growth = all_apart(scans, joined((s1, s3)))
    growth.ask_again()
    assert growth.next_merge(linked({})) is None
    a, b = growth.blocks[0], growth.blocks[1]
    growth.replace((0, 1), Block({**a.poses, **b.poses}, {**a.seen, **b.seen}, a.sights + b.sights))
    assert grown(growth, linked({frozenset((s2, s3)): 2.0})) == [2.0]
