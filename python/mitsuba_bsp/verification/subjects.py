"""Which accelerators are verified: every tree that the core lists, in every variant that its settings name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .. import _core
from ..messages import choices
from ..spec import Setting, Spec, parse_spec, specs, value_text
from .check import Subject

#: Variants get this share of the full counts.
VARIANT_SHARE = 0.1

#: What no list of names in a setting's documentation leads to: trees that are deeper, shallower, of other directions.
MORE_OF_EACH = ("intersection_cost=2",)
MORE = {
    "auto": ("expected_rays=0", "expected_rays=1e15"),
    "rbsp": ("directions=spiral,k=8", "layout=binary,cached_dots=false"),
    "normals": ("k=3", "k=32", "axes=none,k=1", "leaf_size=64", "max_depth=3"),
}

#: What Mitsuba itself traces with.
INCUMBENTS = ("native", "embree", "embree:robust=true")


def trees() -> list[str]:
    """Every tree of the core, brute force apart."""
    return [name for name in _core.trees() if name != "brute"]


def default_subjects(everything_in_full: bool = False) -> tuple[Subject, ...]:
    """One spec for each tree, and one for each value of each of its settings that is a choice between names."""
    mains = [Subject(parse_spec(tree), 1.0) for tree in trees()]
    share = 1.0 if everything_in_full else VARIANT_SHARE
    return (*mains, *(Subject(spec, share) for tree in trees() for spec in _variants(tree)))


def chosen_subjects(texts: Sequence[str]) -> tuple[Subject, ...]:
    """The specs that a user names, each with full counts; ValueError for what is no tree of ours."""
    chosen = [parse_spec(text) for text in dict.fromkeys(texts)]
    for spec in chosen:
        if not spec.is_tree or spec.name == "brute":
            raise ValueError(f'spec "{spec.text}": only trees can be verified (valid names: {choices(trees())})')
    return tuple(Subject(spec, 1.0) for spec in chosen)


def incumbents() -> tuple[Spec, ...]:
    """What Mitsuba itself traces with."""
    return tuple(parse_spec(text) for text in INCUMBENTS)


def _variants(tree: str) -> Iterator[Spec]:
    for setting in specs()[tree]:
        for value in _other_names(setting):
            try:
                yield parse_spec(f"{tree}:{setting.name}={value}")
            except ValueError:  # this value goes only with others
                continue
    more_of_each = (more for more in MORE_OF_EACH if more.partition("=")[0] in parse_spec(tree).settings)
    yield from (parse_spec(f"{tree}:{more}") for more in (*more_of_each, *MORE.get(tree, ())))


def _other_names(setting: Setting) -> list[str]:
    """The values besides the default of a setting that is a choice between names."""
    if setting.type == "bool":
        names = ["true", "false"]
    elif setting.values.startswith("one of "):
        names = setting.values.removeprefix("one of ").split(", ")
    else:
        names = []
    return [name for name in names if name != value_text(setting.default)]
