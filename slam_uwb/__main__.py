"""``python -m slam_uwb``: the same as ``slam-uwb``."""

from .cli import main

if __name__ == "__main__":
    main()
