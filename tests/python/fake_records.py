"""Records of studies that were made up: what the workers of every kind would have found in two small scenes."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from fake_workers import Workers, statistics, work

from mitsuba_bsp import _core
from mitsuba_bsp.comparison import SceneInfo
from mitsuba_bsp.jobs import Job
from mitsuba_bsp.records import Record, ResultsFolder
from mitsuba_bsp.scene_content import Content
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.studies import normals
from mitsuba_bsp.studies.study import SHUFFLE_SEED, Cell, Study, StudyOptions, arrays_file
from mitsuba_bsp.studies.work import save_arrays


def scene(name: str, triangles: int) -> SceneInfo:
    return SceneInfo(name, Path(f"{name}.xml"), "0", Content(triangles, 2, {}), 4, (8, 8), True, True)


SCENES = (scene("feet", 20), scene("room", 30))


def _found(cell: Cell, repeat: int, folder: ResultsFolder, scene: str) -> dict[str, Any]:
    """What a worker would find."""
    spec = cell.spec(repeat)
    arrays = arrays_file(folder, cell.measure, scene, spec.text)
    return _BY_MEASURE[cell.measure](spec.text, arrays)


def _time(text: str, _: Path) -> dict[str, Any]:
    return dict(Workers().run(Job("time", "", "scalar_rgb", text)).values)


def _planes(text: str, _: Path) -> dict[str, Any]:
    spec = parse_spec(text)
    traits = _core.traits(spec.name, dict(spec.options))
    return {"statistics": statistics(spec.name), "planes": [(9, 9), (12, 8)], "whole": (21, 12), "traits": traits}


def _converge(_: str, arrays: Path) -> dict[str, Any]:
    save_arrays(arrays, {str(passes): np.ones((2, 2, 3)) for passes in (1, 2)})
    points = [{"passes": n, "seconds": 1.0 * n, "relmse": 1 / n, "flip": None} for n in (1, 2)]
    return {"build_s": 0.5, "points": points, "statistics": {}}


def _normals(_: str, arrays: Path) -> dict[str, Any]:
    parts: dict[str, Any] = {}
    for number in range(len(normals.DEPTHS)):
        parts |= {f"map{number}": np.full((normals.BINS, normals.BINS), 1e-3, np.float32)}
        parts |= {f"directions{number}": np.eye(3, dtype=np.float32), f"depths{number}": np.arange(3, dtype=np.uint8)}
    save_arrays(arrays, parts)
    shares = dict.fromkeys(("oblique_share", "oblique_share_at_top", "parallel_share", "axis_area_share"), 0.5)
    nodes = [{"depth": depth, "triangles": 9} for depth in normals.DEPTHS]
    return {"nodes": nodes, "interior_nodes": 7, **shares}


def _slice(_: str, arrays: Path) -> dict[str, Any]:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    parts = {
        "cells": square[None],
        "depth": np.ones(1, np.uint8),
        "cost": np.ones(1, np.float32),
        "segments": square[None, :2],
        "planes": np.zeros((0, 4, 3), np.float32),
        "levels": np.zeros(0, np.uint8),
        "oblique": np.zeros(0, bool),
        "points": np.eye(3, dtype=np.float32),
        "box": np.array([[0, 0, 0], [1, 1, 1]], np.float32),
    }
    save_arrays(arrays, parts)
    means = dict.fromkeys(("empty_area", "mean_depth", "mean_cost", "triangles_per_cell"), 0.5)
    return {"plane": [0.0, 0.0, 1.0, 0.5], "cells": 1, **means}


_BY_MEASURE: dict[str, Callable[[str, Path], dict[str, Any]]] = {
    "time": _time,
    "work": lambda text, _: work(text),
    "planes": _planes,
    "converge": _converge,
    "normals": _normals,
    "slice": _slice,
}


def records(
    study: Study, words: Sequence[str], folder: ResultsFolder, scenes: Sequence[SceneInfo] = SCENES
) -> list[Record]:
    """All of a study with these options, shuffled in rounds as its own are; arrays are left in the folder."""
    parser = argparse.ArgumentParser()
    chosen = study.add_options(parser)
    args = parser.parse_args(words)
    choices = {name: getattr(args, name) for name in chosen}
    repeats = max(2, study.least_repeats)
    cells = study.plan(StudyOptions((), (), folder.path, "scalar_rgb", repeats, {}, choices=choices))
    rng = np.random.default_rng(SHUFFLE_SEED)
    rows = []
    for repeat in range(max(cell.repeats for cell in cells)):
        turns = [(scene, cell) for scene in scenes for cell in cells if repeat < cell.repeats]
        for scene, cell in (turns[place] for place in rng.permutation(len(turns))):
            rows.append(
                {
                    "scene": scene.name,
                    "triangles": scene.triangles,
                    "resolution": scene.resolution,
                    "spp": scene.spp,
                    "threads": 1,
                    "measure": cell.measure,
                    "tree": cell.tree,
                    "spec": cell.spec(repeat).text,
                    "spec_full": cell.spec(repeat).full,
                    "repeat": repeat,
                    **_found(cell, repeat, folder, scene.name),
                }
            )
    return rows
