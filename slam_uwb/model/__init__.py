"""The shared language of all steps: geometry, what was measured, products, solution, settings, errors."""
