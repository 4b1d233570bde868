"""Byte and line examples of the protocol notes, sections 5.3 to 8, and damaged ones."""

import numpy as np
import pytest

from slam_uwb.capture.frames import dwm1001_tlv, dwm3001, mauwb, trek1000
from slam_uwb.capture.samples import Carry

TLV = bytes.fromhex(
    "40 01 00 41 0d ce 04 00 00 3e fe ff ff d4 03 00 00 4d 49 29 02 2e 02 70 0d 00 00 64 04 1f 00 00"
    "5e 1f 00 00 00 00 00 00 64 80 92 30 16 00 00 64 0e 1f 00 00 00 00 00 00 00 00 00 00 64"
)


def pairs(epoch):
    return [(item.anchor, item.distance) for item in epoch.readings]


def test_tlv():
    found = dwm1001_tlv.decode(b"\x40\x01\x04" + TLV + TLV[:30], Carry())
    (epoch,) = found.samples
    assert pairs(epoch) == [("022E", 3.44), ("9280", 5.68)]
    assert found.tally.dropped == {"refusals": 1}
    assert found.carry.rest == TLV[:30]


def test_tlv_of_an_anchor():
    # Two of 13 bytes: u64 address, u32 mm, quality.
    row = (0xDECA00000000022E).to_bytes(8, "little") + (1234).to_bytes(4, "little") + b"\x64"
    (epoch,) = dwm1001_tlv.decode(TLV[:18] + b"\x48\x0e\x01" + row, Carry()).samples
    assert pairs(epoch) == [("022E", 1.234)]


@pytest.mark.parametrize("place", [0, 1, 3, 4, 18, 19, 20])
def test_tlv_with_a_wrong_header_is_passed_over(place):
    spoilt = bytearray(TLV)
    spoilt[place] ^= 0x40
    found = dwm1001_tlv.decode(bytes(spoilt) + TLV, Carry(), last=True)
    assert [pairs(epoch) for epoch in found.samples] == [[("022E", 3.44), ("9280", 5.68)]]


def test_trek_tag_to_anchors():
    line = "mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0"
    epoch = trek1000.parse_report(line)
    assert pairs(epoch) == [("A0", 1.635), ("A1", 1.443), ("A2", 1.298), ("A3", 1.227)]
    assert (epoch.tag, epoch.sequence) == ("0", 193)
    assert len(trek1000.parse_report(line.replace("a0:0", "t0:a0"))) == 4
    # A slot out of the mask holds an old value.
    assert [a for a, _ in pairs(trek1000.parse_report(line.replace("mc 0f", "mc 05")))] == [
        "A0",
        "A2",
    ]


def test_trek_negative_range():
    line = "mc 01 ffffffce 000005a3 00000512 000004cb 095f c1 00024c24 a0:0"
    assert pairs(trek1000.parse_report(line)) == [("A0", -0.05)]


def test_trek_between_anchors():
    epoch = trek1000.parse_report("ma 07 00000000 0000085c 00000659 000006b7 095b 26 00024bed a0:0")
    assert [(item.anchor, item.other, item.distance) for item in epoch.readings] == [
        ("A0", "A1", 2.140),
        ("A0", "A2", 1.625),
        ("A1", "A2", 1.719),
    ]


@pytest.mark.parametrize(
    "line",
    [
        "mc 0f 00000663 000005a3 0000051g 000004cb 095f c1 00024c24 a0:0",
        "mc 0f 00000663 000005a3 0000512 000004cb 095f c1 00024c24 a0:0",
        "mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24",
    ],
)
def test_trek_garbled(line):
    found = trek1000.decode(f"{line}\r\n".encode(), Carry())
    assert found.samples == ()
    assert found.tally.dropped == {"garbled lines": 1}


def test_trek_raw_lines_repeat_others():
    line = b"mr 0f 00000663 000005a3 00000512 000004cb 095f c1 40424042 a0:0\r\n"
    found = trek1000.decode(line, Carry())
    assert (found.samples, found.tally.dropped) == ((), {})


def test_mauwb_first_form():
    epoch = mauwb.parse_report(
        "AT+RANGE=tid:1,mask:04,seq:63,range:(0,0,30,0,0,0,0,0),rssi:(0,0,-78.5,0,0,0,0,0)"
    )
    assert pairs(epoch) == [("A2", 0.30)]
    assert epoch.readings[0].rss_dbm == -78.5


def test_mauwb_with_anchor_identifiers():
    line = (
        "AT+RANGE=tid:0,mask:0F,seq:79,range:(522,360,122,343,0,0,0,0),ancid:(0,1,2,5,-1,-1,-1,-1)"
    )
    assert pairs(mauwb.parse_report(line)) == [
        ("A0", 5.22),
        ("A1", 3.60),
        ("A2", 1.22),
        ("A5", 3.43),
    ]
    assert mauwb.parse_report(line[:-1]) is None
    assert mauwb.parse_report(line.replace("(0,1,2,5", "(0,1,1,5")) is None


JSON = (
    '{"Block":12, "results":[{"Addr":"0x0001","Status":"Ok","D_cm":40,"LPDoA_deg":0.00,"CFO_100ppm":-5},'
    '{"Addr":"0x0002","Status":"Err"}],"RSSI_dBm":"-66.5","NLOS_%":3}'
)
NOTIFICATION = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=0, block_index=7, n_measurements=2\r\n"
    ' [mac_address=0x0001, status="SUCCESS", distance[cm]=152, RSSI[dBm]=-61.0];\r\n'
    ' [mac_address=0x0002, status="RX_TIMEOUT"]}\r\n'
)


def test_dwm3001_json():
    epoch = dwm3001.parse_json(JSON)
    assert epoch.sequence == 12
    assert [item.anchor for item in epoch.readings] == ["0001", "0002"]
    assert epoch.readings[0].distance == 0.40
    assert epoch.readings[0].rss_dbm == -66.5
    assert np.isnan(epoch.readings[1].distance)
    assert epoch.readings[1].quality == "Err"


def test_dwm3001_notification_over_several_lines():
    stream = f"ok\r\n{NOTIFICATION}{JSON}\r\n".encode()
    found = dwm3001.decode(stream, Carry())
    first, second = found.samples
    assert (first.sequence, second.sequence) == (7, 12)
    assert first.readings[0].distance == 1.52
    assert first.readings[0].rss_dbm == -61.0
    assert first.readings[1].quality == "RX_TIMEOUT"
    assert found.tally.dropped == {}


def test_dwm3001_notification_on_one_line():
    text = (
        "SESSION_INFO_NTF: {session_handle=1, sequence_number=0, block_index=0, n_measurements=2 "
        '[mac_address=0x0001, status="SUCCESS", distance[cm]=152] [mac_address=0x0002, status="RX_TIMEOUT"]}'
    )
    assert [item.anchor for item in dwm3001.parse_notification(text).readings] == ["0001", "0002"]


@pytest.mark.parametrize(
    "damaged",
    [
        JSON[:-20],
        JSON.replace('"Ok"', '"Ok" "Ok"'),
        JSON.replace('"D_cm":40,', ""),
        JSON.replace("0x0002", "0x0001"),
        JSON.replace("40,", "NaN,"),
        NOTIFICATION.replace("n_measurements=2", "n_measurements=3"),
        NOTIFICATION.replace("distance[cm]=152", "distance[cm]=1x2"),
        # The next notification begins inside this one.
        NOTIFICATION[:120] + "\r\n",
    ],
)
def test_dwm3001_damaged(damaged):
    found = dwm3001.decode(f"{damaged}\r\n{NOTIFICATION}".encode(), Carry())
    assert len(found.samples) == 1
    assert found.samples[0].sequence == 7
    assert found.tally.dropped == {"garbled lines": 1}
