import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from slam_uwb.io import tables
from slam_uwb.io.files import FileContent
from slam_uwb.io.findings import Findings, shown
from slam_uwb.io.tables import Column, read_table

COLUMNS = (Column("a", finite=True), Column("b", may_be_empty=True))

cells = st.one_of(
    st.floats(width=64).map(repr),
    st.integers().map(str),
    st.text("0123456789+-.eEnaif_x \t\u0661", max_size=6),
    st.sampled_from(["", " ", "nan", "-inf", "1e400", "1_0", "0x1p3", ".5", "5.", "1d3", '"2"']),
)
rows = st.lists(st.lists(cells, min_size=1, max_size=3).map(",".join), max_size=6)


@settings(deadline=None)
@given(rows)
@example(["1,2", "1,", "-.5e-3,nan"])
@example(["", "1,2", "  "])
def test_fast_way_agrees_with_cell_by_cell(lines):
    """Whatever the fast way accepts, the careful one reads as the same numbers on the same lines."""
    body = "\n".join(lines)
    fast = tables._read_numbers(body, ["a", "b"], list(COLUMNS), "t.csv")
    findings = Findings()
    slow = tables._read_cells(body, ["a", "b"], list(COLUMNS), "t.csv", findings)
    if fast is None:
        return
    assert findings.faults == ()
    assert slow.sound
    np.testing.assert_array_equal(fast.lines, slow.lines)
    for name in ("a", "b"):
        np.testing.assert_array_equal(fast.numbers[name], slow.numbers[name])


def test_fast_way_takes_what_recordings_look_like():
    """Or else everything above is true of nothing."""
    body = "1,2\n3,\n4,nan\n5,0\n"
    fast = tables._read_numbers(body, ["a", "b"], list(COLUMNS), "t.csv")
    np.testing.assert_array_equal(fast.numbers["b"], [2.0, np.nan, np.nan, 0.0])
    np.testing.assert_array_equal(fast.lines, [2, 3, 4, 5])
    wide = [*COLUMNS, Column("c", may_be_empty=True), Column("d", may_be_empty=True)]
    fast = tables._read_numbers("1,,,\n2,,,5\n", ["a", "b", "c", "d"], wide, "t.csv")
    np.testing.assert_array_equal(fast.numbers["d"], [np.nan, 5.0])


@settings(deadline=None)
@given(st.binary(max_size=200))
@example(b"a,b\n1,2\n\xff")
@example(b"a,b\r1,2\r")
@example(b"")
def test_any_bytes_give_a_table_or_a_fault(data):
    findings = Findings()
    table = read_table(FileContent("t.csv", data), COLUMNS, findings)
    assert (table is not None and table.sound) == (findings.faults == ())


def test_columns_of_numbers_beside_text():
    data = b"b,id,a\n1, x ,2\n,y,3\n"
    columns = (*COLUMNS, Column("id", number=False))
    table = read_table(FileContent("t.csv", data), columns, Findings())
    assert table.texts["id"] == ("x", "y")
    np.testing.assert_array_equal(table.numbers["a"], [2.0, 3.0])
    np.testing.assert_array_equal(table.numbers["b"], [1.0, np.nan])


def test_shown_is_short_and_printable():
    assert shown("a\x1b[0m\u202e") == '"a\\u001b[0m\\u202e"'
    assert len(shown("x" * 10_000)) < 70
