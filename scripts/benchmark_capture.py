"""Throughput of every decoder on one core, against the line rate of its device.

python scripts/benchmark_capture.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import reduce

import numpy as np

from slam_uwb.capture.frames import ld06, sweep
from slam_uwb.capture.ports import LIDARS, TAGS
from slam_uwb.capture.samples import Carry, LidarSamples

SECONDS = 60.0
CHUNK = 512
"""Bytes a read, as they come from a port at the pace of the recording loop."""


def sweep_stream(rng: np.random.Generator) -> bytes:
    """Blocks at random places."""
    number = 30_000
    return sweep.encode(
        LidarSamples(
            np.deg2rad(rng.integers(0, 5760, number) / 16.0),
            rng.integers(2, 2500, number) / 100.0,
            np.full(number, 150.0),
            np.arange(0, number, 250),
        )
    )


def node_stream(rng: np.random.Generator) -> bytes:
    """Standard nodes of an RPLIDAR."""
    number = 60_000
    angles = (np.arange(number) % 320 * 72).astype(np.int64)
    distances = rng.integers(800, 40_000, number)
    starts = np.arange(number) % 320 == 0
    nodes = np.stack(
        [
            15 << 2 | np.where(starts, 1, 2),
            (angles & 0x7F) << 1 | 1,
            angles >> 7,
            distances & 0xFF,
            distances >> 8,
        ],
        axis=1,
    )
    return nodes.astype(np.uint8).tobytes()


def capsule_stream(rng: np.random.Generator) -> bytes:
    """Express or dense capsules of 12 degrees: header and checksum are those of both."""
    capsules = []
    for k in range(3_000):
        word = (k * 12 % 360) * 64 | (0x8000 if k == 0 else 0)
        body = word.to_bytes(2, "little") + rng.integers(0, 256, 80, dtype=np.uint8).tobytes()
        check = reduce(lambda a, b: a ^ b, body)
        capsules.append(bytes([0xA0 | check & 0xF, 0x50 | check >> 4]) + body)
    return b"".join(capsules)


def ld06_stream(rng: np.random.Generator) -> bytes:
    """Frames of twelve points."""
    number = 10_000
    frames = rng.integers(0, 256, (number, 46), dtype=np.uint8)
    frames[:, :2] = 0x54, 0x2C
    return np.column_stack([frames, ld06.checksum(frames)]).tobytes()


LES = (
    b"022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 DCAE[0.00,8.03,0.00]=7.73 "
    b"5431[0.00,0.00,0.00]=9.01 le_us=3082 est[6.97,5.17,-1.77,53]\r\n"
)
TLV = bytes.fromhex(
    "40010041 0dce040000 3efeffff d4030000 4d 49 29 02 2e02 700d0000 64 041f0000 5e1f0000 00000000 64"
    "8092 30160000 64 0e1f0000 00000000 00000000 64"
)
TREK = b"mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0\r\n"
MAUWB = (
    b"AT+RANGE=tid:0,mask:0F,seq:79,range:(522,360,122,343,0,0,0,0),ancid:(0,1,2,3,-1,-1,-1,-1)\r\n"
)
JSON = b'{"Block":12, "results":[{"Addr":"0x0001","Status":"Ok","D_cm":40},{"Addr":"0x0002","Status":"Err"}]}\r\n'
STREAMS: dict[str, Callable[[np.random.Generator], bytes]] = {
    "sweep": sweep_stream,
    **dict.fromkeys(("rplidar-a1", "rplidar-a2", "rplidar-a3", "rplidar-c1"), node_stream),
    **dict.fromkeys(("rplidar-a2-express", "rplidar-c1-dense", "rplidar-s1"), capsule_stream),
    "ld06": ld06_stream,
    "dwm1001": lambda _: LES * 2_000,
    "dwm1001-tlv": lambda _: TLV * 4_000,
    "dwm3001": lambda _: JSON * 3_000,
    "trek1000": lambda _: TREK * 4_000,
    "mauwb": lambda _: MAUWB * 3_000,
}


def main() -> None:
    """Print a table: MB/s on sound streams and on noise, and the ratio to the line rate."""
    print("| device | line rate kB/s | sound, in chunks | noise, in chunks | times the line rate |")
    print("| --- | --- | --- | --- | --- |")
    for name, make in STREAMS.items():
        line, sound, noise = throughput(name, make)
        print(
            f"| {name} | {line / 1e3:.1f} | {sound / 1e6:.2f} MB/s | {noise / 1e6:.2f} MB/s "
            f"| {min(sound, noise) / line:.0f} |"
        )


def throughput(
    name: str, make: Callable[[np.random.Generator], bytes]
) -> tuple[float, float, float]:
    """Bytes a second: of the device's line, decoded from a sound stream, decoded from noise."""
    rng = np.random.default_rng(0)
    device = {**LIDARS, **TAGS}[name]
    noise = rng.integers(0, 256, 400_000, dtype=np.uint8).tobytes()
    return device.baud / 10.0, _rate(device.decode, make(rng)), _rate(device.decode, noise)


def _rate(decode: Callable[..., object], data: bytes) -> float:
    """Bytes a second of processor time."""
    carry, begun = Carry(), time.process_time()
    for start in range(0, len(data), CHUNK):
        carry = decode(data[start : start + CHUNK], carry).carry  # type: ignore[attr-defined]
    return len(data) / (time.process_time() - begun)


if __name__ == "__main__":
    main()
