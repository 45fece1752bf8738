"""BSP-tree accelerators for Mitsuba 3, in any scene.

Importing this package lets Mitsuba find the plugins `bsptree` and `nativekdtree`; it sets no variant.
"""

from .installation import check_extension, check_mitsuba, check_processor, plugin_dir, register_plugins, scenes_dir

check_mitsuba()
check_processor()
check_extension()
register_plugins()

from .accelerator import NO_TRIANGLE, Accelerator, faults, survey_planes  # noqa: E402
from .loading import load_dict, load_file, load_string  # noqa: E402
from .spec import Setting, Spec, parse_spec, specs  # noqa: E402
from .tree_statistics import shapes, statistics  # noqa: E402

__all__ = [
    "NO_TRIANGLE",
    "Accelerator",
    "Setting",
    "Spec",
    "faults",
    "load_dict",
    "load_file",
    "load_string",
    "parse_spec",
    "plugin_dir",
    "scenes_dir",
    "shapes",
    "specs",
    "statistics",
    "survey_planes",
]
