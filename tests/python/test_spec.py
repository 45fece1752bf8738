"""Spec texts: what they mean, and that every mistake is named together with the valid choices."""

from __future__ import annotations

import pytest

from mitsuba_bsp import parse_spec, specs
from mitsuba_bsp.figures import COLOURS
from mitsuba_bsp.spec import Setting, with_setting


def test_names_are_mitsubas_accelerators_and_our_trees() -> None:
    assert list(specs())[:2] == ["embree", "native"]
    assert {"kd", "ize", "random", "normals", "clustered", "brute"} <= set(specs())


def test_every_accelerator_has_a_colour_in_figures() -> None:
    assert set(specs()) == set(COLOURS)


def test_a_spec_keeps_its_text_and_knows_all_settings() -> None:
    spec = parse_spec(" native:kd_clip=false ")
    assert (spec.text, spec.name, spec.options) == ("native:kd_clip=false", "native", {"kd_clip": "false"})
    assert spec.settings["kd_clip"] is False
    assert spec.settings["kd_stop_prims"] == 3
    assert "kd_clip=false" in spec.full and "kd_stop_prims=3" in spec.full


@pytest.mark.parametrize("name", ["embree", "native", "kd", "ize", "random", "normals", "clustered", "brute"])
def test_the_full_text_is_a_spec_with_the_same_meaning(name: str) -> None:
    spec = parse_spec(name)
    again = parse_spec(spec.full)
    assert again.settings == spec.settings
    assert again.full == spec.full


@pytest.mark.parametrize("name", ["embree", "native", "kd", "normals"])
def test_listed_settings_are_those_of_the_spec(name: str) -> None:
    assert {setting.name: setting.default for setting in specs()[name]} == parse_spec(name).settings


@pytest.mark.parametrize(
    ("text", "mistake", "valid"),
    [
        ("", '""', "clustered"),
        ("kdd", 'did you mean "kd"', "clustered"),
        ("KD", '"KD"', "kd"),
        ("kd:", "after the colon", "key=value"),
        ("normals:k", '"k"', "key=value"),
        ("normals:k=", '"k="', "key=value"),
        ("normals:k=6,k=7", '"k"', "twice"),
        ("normals:k=0", "k", "1"),
        ("normals:k=1000", "1000", "1"),
        ("normals:k=six", "six", "1"),
        ("normals:axes=slow", "slow", "fast"),
        ("normals:axis=fast", "axis", "axes"),
        ("kd:triangle_test=moller", "moller", "woop"),
        ("embree:robust=yes", '"yes"', "true, false"),
        ("embree:robus=true", 'did you mean "robust"', "robust"),
        ("native:kd_stop_prims=0", '"0"', "from 1 to 2^30"),
        ("native:kd_traversal_cost=nan", '"nan"', "from 1e-6 to 2^30"),
        ("native:kd_stop_prims=70000", "70000", "kd_exact_primitive_threshold"),
    ],
)
def test_a_mistake_is_named_with_the_valid_choices(text: str, mistake: str, valid: str) -> None:
    with pytest.raises(ValueError) as caught:
        parse_spec(text)
    message = str(caught.value)
    assert f'spec "{text}"' in message
    assert mistake in message
    assert valid in message
    assert "\n" not in message


@pytest.mark.parametrize(("text", "value"), [("2", 2), ("7", 7)])
def test_a_setting_reads_values_in_its_range(text: str, value: int) -> None:
    assert Setting("n", "int", 2, "2 to 7", "", 2, 7).parse(text) == value


@pytest.mark.parametrize("text", ["1", "8", "2.5", "two", ""])
def test_a_setting_refuses_values_out_of_its_range(text: str) -> None:
    with pytest.raises(ValueError, match="2 to 7"):
        Setting("n", "int", 2, "2 to 7", "", 2, 7).parse(text)


def test_a_setting_is_added() -> None:
    assert [with_setting(text, "layout=wide") for text in ("kd", "normals:k=4")] == [
        "kd:layout=wide",
        "normals:k=4,layout=wide",
    ]
    assert with_setting("kd", "") == "kd"
