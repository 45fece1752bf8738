"""Accelerator specs: one text, `NAME[:key=value,...]`, names an accelerator everywhere."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from . import _core
from .messages import choices, hint

Value = bool | int | float | str

#: `brute` tests every triangle for every ray: beyond this many it would seem to hang.
BRUTE_MAX_TRIANGLES = 20_000


@dataclass(frozen=True)
class Setting:
    """One key of an accelerator: its type, default and valid values as text, and its meaning."""

    name: str
    type: str
    default: Value
    values: str
    meaning: str
    lowest: float = -math.inf
    highest: float = math.inf

    def parse(self, text: str) -> Value:
        """The value that `text` stands for; ValueError with the valid values otherwise."""
        error = ValueError(f'"{self.name}" cannot be "{text}" (valid: {self.values})')
        if self.type == "bool":
            if text.lower() not in ("true", "false"):
                raise error
            return text.lower() == "true"
        try:
            value = int(text) if self.type == "int" else float(text)
        except ValueError:
            raise error from None
        if not self.lowest <= value <= self.highest:
            raise error
        return value


@dataclass(frozen=True)
class Spec:
    """A checked accelerator.

    `text` is what the user wrote, `options` the keys given there, `settings` every key with its value, and
    `full` the spec text that spells out all of `settings`.
    """

    text: str
    name: str
    options: Mapping[str, str] = field(hash=False)
    settings: Mapping[str, Value] = field(hash=False, repr=False)
    full: str

    @property
    def is_tree(self) -> bool:
        """Whether this is one of our own trees (not Embree, not Mitsuba's kd-tree)."""
        return self.name not in _FOREIGN

    @property
    def is_exact(self) -> bool:
        """Whether it promises the answers of brute force with its triangle test; the other modes are measured."""
        safe = self.settings.get("precision") not in ("fast", "epsilon")
        return self.is_tree and safe and self.settings.get("early_exit") != "plane"

    @property
    def plugin(self) -> str | None:
        """The shape plugin that groups the triangles; None if Embree takes them as they are."""
        return {"embree": None, "native": "nativekdtree"}.get(self.name, "bsptree")


_FOREIGN: dict[str, tuple[Setting, ...]] = {
    "embree": (
        Setting("robust", "bool", False, "true, false", "Embree's robust mode, slower and with fewer leaks"),
    ),
    # The defaults are Mitsuba's own (render/kdtree.h and kdtree.cpp of 3.9.1).
    "native": (
        Setting(
            "kd_intersection_cost", "float", 20.0, "a number from 1e-6 to 2^30", "SAH price of a triangle test",
            1e-6, 2**30,
        ),
        Setting("kd_traversal_cost", "float", 15.0, "a number from 1e-6 to 2^30", "SAH price of a step", 1e-6, 2**30),
        Setting(
            "kd_empty_space_bonus", "float", 0.9, "a number from 1e-6 to 1", "SAH factor for an empty side",
            1e-6, 1,
        ),
        Setting(
            "kd_stop_prims", "int", 3, "an integer from 1 to 2^30", "nodes with this many triangles are leaves",
            1, 2**30,
        ),
        Setting("kd_max_depth", "int", 0, "0 to 48", "deepest level, 0 = 8 + 1.3 log2(triangles)", 0, 48),
        Setting("kd_min_max_bins", "int", 128, "an integer from 2 to 2^20", "bins of the approximate sweep", 2, 2**20),
        Setting("kd_clip", "bool", True, "true, false", "clip triangles to their cell"),
        Setting("kd_retract_bad_splits", "bool", True, "true, false", "take back splits that did not pay"),
        Setting(
            "kd_exact_primitive_threshold", "int", 65536, "an integer from 2 to 2^30, above kd_stop_prims",
            "nodes with more triangles than this are binned, the others swept exactly", 2, 2**30,
        ),
    ),
}  # fmt: skip


def names() -> list[str]:
    """Every valid accelerator name."""
    return [*_FOREIGN, *_core.trees()]


def specs() -> dict[str, tuple[Setting, ...]]:
    """Every accelerator name with its settings."""
    ours = {
        tree: tuple(
            Setting(line["name"], type(line["default"]).__name__, line["default"], line["values"], line["meaning"])
            for line in _core.settings_help(tree)
        )
        for tree in _core.trees()
    }
    return _FOREIGN | ours


def parse_spec(text: str) -> Spec:
    """Check a spec text; ValueError names the mistake and the valid choices."""
    text = text.strip()
    name, colon, rest = text.partition(":")
    if name not in names():
        raise ValueError(
            f'spec "{text}": there is no accelerator "{name}"{hint(name, names())} (valid: {choices(names())})'
        )
    if colon and not rest:
        raise ValueError(f'spec "{text}": there is nothing after the colon, give key=value or leave the colon out')
    return make_spec(name, _options(text, rest), text)


def make_spec(name: str, options: Mapping[str, str], text: str) -> Spec:
    """Check the options of a known accelerator; `text` is how the user named it, for messages."""
    try:
        settings = _foreign_settings(name, options) if name in _FOREIGN else dict(_core.settings(name, dict(options)))
    except ValueError as error:
        raise ValueError(f'spec "{text}": {error}') from None
    listed = ",".join(f"{key}={value_text(value)}" for key, value in settings.items())
    return Spec(text, name, dict(options), settings, f"{name}:{listed}" if listed else name)


def spec_text(name: str, **options: Value | None) -> str:
    """The spec with these options; those that are None are left out."""
    pairs = ",".join(f"{key}={value_text(value)}" for key, value in options.items() if value is not None)
    return f"{name}:{pairs}" if pairs else name


def with_setting(text: str, setting: str) -> str:
    """The spec with one more setting, unless that is empty."""
    return f"{text}{',' if ':' in text else ':'}{setting}" if setting else text


def shortest(text: str) -> str:
    """The same accelerator, with only those settings that are not its defaults."""
    spec = parse_spec(text)
    found = spec.name
    kept: dict[str, Value] = {}
    for key, value in spec.settings.items():  # in an order in which those that decide others' defaults come first
        if parse_spec(found).settings[key] != value:
            kept[key] = value
            found = spec_text(spec.name, **kept)
    return found


def value_text(value: Value) -> str:
    """A value as it is written in a spec."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _options(text: str, rest: str) -> dict[str, str]:
    """The key=value pairs behind the colon."""
    options: dict[str, str] = {}
    for pair in rest.split(",") if rest else []:
        key, equals, value = (part.strip() for part in pair.partition("="))
        if not (key and equals and value):
            raise ValueError(f'spec "{text}": "{pair}" is not of the form key=value')
        if key in options:
            raise ValueError(f'spec "{text}": "{key}" is given twice')
        options[key] = value
    return options


def _foreign_settings(name: str, options: Mapping[str, str]) -> dict[str, Value]:
    """All settings of `embree` or `native`, given or default."""
    table = {setting.name: setting for setting in _FOREIGN[name]}
    for key in options:
        if key not in table:
            raise ValueError(f'"{name}" has no key "{key}"{hint(key, table)} (valid: {choices(table)})')
    values = {key: s.parse(options[key]) if key in options else s.default for key, s in table.items()}
    if name == "native" and values["kd_exact_primitive_threshold"] <= values["kd_stop_prims"]:
        raise ValueError(
            f'"kd_exact_primitive_threshold" is {values["kd_exact_primitive_threshold"]} but must be above '
            f'"kd_stop_prims", which is {values["kd_stop_prims"]}'
        )
    return values
