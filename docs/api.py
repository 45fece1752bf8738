"""Make the documentation of the Python package from its docstrings: `python docs/api.py FOLDER` (needs pdoc)."""

import sys
from pathlib import Path

import mitsuba as mi
import pdoc

#: What Mitsuba's classes are called is known only in a variant.
mi.set_variant("scalar_rgb")

if __name__ == "__main__":
    pdoc.render.configure(docformat="google")
    pdoc.pdoc("mitsuba_bsp", r"!mitsuba_bsp\..+", output_directory=Path(sys.argv[1]))
