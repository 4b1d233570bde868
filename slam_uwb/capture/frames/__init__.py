"""Bytes -> samples: pure functions that find the sound frames of a damaged stream and count the rest."""
