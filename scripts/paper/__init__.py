"""The paper's tables and figures, one module each; `scripts/reproduce.py` makes them all."""
