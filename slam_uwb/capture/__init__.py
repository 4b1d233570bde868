"""Instruments: bytes <-> samples (`frames`), serial ports (`ports`), and devices to test with (`emulator`)."""
