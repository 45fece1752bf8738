"""`python -m mitsuba_bsp` is the command `mitsuba-bsp`."""

from .cli import main

main()
