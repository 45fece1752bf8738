"""What the workers of studies find: costs of pixels, planes, maps of normals, cross-sections."""

from __future__ import annotations

import json
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import qmc

import mitsuba_bsp
from mitsuba_bsp.contenders import COUNTERS
from mitsuba_bsp.exr import read_exr
from mitsuba_bsp.jobs import Job
from mitsuba_bsp.rendering import construct, load
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.studies import convergence, normals, planes, work
from mitsuba_bsp.studies import slice as cross_section
from mitsuba_bsp.swap import GroupOptions
from mitsuba_bsp.verification.audit import neutral_tree
from mitsuba_bsp.verification.meshes import Mesh, boxes, soup, sphere

RESOLUTION, SPP = 12, 3


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from conftest import ROOM

    path = tmp_path_factory.mktemp("scene") / "room.xml"
    path.write_text(ROOM)
    return path


class TestWork:
    """The rays of a frame under one accelerator."""

    def job(self, scene: Path, spec: str, image: str = "") -> Job:
        sizes = {"spp": SPP, "resolution": RESOLUTION, "seed": 1}
        return Job("work", str(scene), "scalar_rgb", spec, image=image, **sizes)

    @pytest.mark.parametrize("spec", ["kd", "normals:layout=binary,intersection_cost=1"])
    def test_counters_are_those_of_the_frame(self, scene: Path, spec: str) -> None:
        found = work.measure(self.job(scene, spec), lambda _: None)
        loaded = load(self.job(scene, spec), lambda _: None, box=True)
        counting, _ = construct(self.job(scene, spec), loaded, lambda _: None, GroupOptions(count=True))
        mi.render(counting, spp=SPP, seed=1)
        counted = mitsuba_bsp.statistics(counting)["counters"]
        kinds = found["counters"]
        assert kinds["camera"]["rays"] == SPP * RESOLUTION**2
        assert kinds["shadow"] == counted["any"]
        assert {name: kinds["camera"][name] + kinds["bounce"][name] for name in counted["closest"]} == counted[
            "closest"
        ]
        assert found["statistics"]["triangles"] == 30
        assert json.dumps(found)

    def test_mitsubas_kd_tree_counts_too(self, scene: Path) -> None:
        found = work.measure(self.job(scene, "native"), lambda _: None)
        assert found["counters"]["camera"]["rays"] == SPP * RESOLUTION**2 and found["statistics"] == {}
        assert found["counters"]["shadow"]["triangle_tests"] > 0

    def test_the_cost_of_all_pixels_is_that_of_all_rays(self, scene: Path, tmp_path: Path) -> None:
        spec = "normals:layout=binary,intersection_cost=1"
        found = work.measure(self.job(scene, spec, str(tmp_path / "work.exr")), lambda _: None)
        prices = parse_spec("normals:layout=binary").settings
        total = 0.0
        for counted in found["counters"].values():
            total += counted["axis_steps"] + prices["oblique_cost"] * counted["oblique_steps"]
            total += prices["intersection_cost"] * counted["triangle_tests"]
        assert total / SPP / RESOLUTION**2 == pytest.approx(found["pixels"]["cost"]["path"]["mean"], rel=1e-4)
        costs = work.pixel_quantities(parse_spec(spec), work.read_counters(read_exr(tmp_path / "work.exr")))["cost"]
        assert costs["path"].shape == costs["camera"].shape == (RESOLUTION, RESOLUTION)
        assert (costs["path"] >= costs["camera"]).all() and costs["camera"].max() > 0
        p99 = float(np.quantile(costs["path"], 0.99))
        assert p99 == pytest.approx(found["pixels"]["cost"]["path"]["quantiles"][99], rel=1e-4)

    def test_a_wide_step_passes_three_planes(self) -> None:
        none = {name: np.zeros((1, 1), np.float32) for name in COUNTERS}
        counted = {of: none | {"axis_steps": np.ones((1, 1), np.float32)} for of in work.PIXELS}
        found = work.pixel_quantities(parse_spec("kd"), counted)
        assert found["cost"]["camera"] == 3 and found["steps"]["camera"] == 1

    def test_area_on_the_axes(self) -> None:
        box = boxes("box", [((0, 0, 0), (1, 2, 3))])
        assert work.axis_area_share(box.vertices, box.faces) == pytest.approx(1)
        turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
        assert work.axis_area_share((box.vertices @ turn).astype(np.float32), box.faces) == 0
        assert work.axis_area_share(box.vertices, box.faces[:0]) == 0


def test_planes_are_counted_and_foretold(scene: Path) -> None:
    found = planes.measure(Job("planes", str(scene), "scalar_rgb", "kd:cost=thesis"), lambda _: None)
    n = found["statistics"]["triangles"]
    foretold = planes.predicted(found)
    assert n == 30 and foretold["considered"] == [6 * n] * len(found["planes"])
    assert set(foretold["different"]) == {6 * n}
    assert all(different <= considered <= 6 * n for considered, different in found["planes"][:1])
    drawn = planes.measure(Job("planes", str(scene), "scalar_rgb", "normals:k=5,cost=thesis"), lambda _: None)
    assert planes.predicted(drawn)["different"][:2] == [(6 + 4) * n, (6 + 8) * n]


class TestNormals:
    """Maps of normals and directions."""

    @pytest.mark.parametrize("spec", ["kd", "normals", "ize"])
    def test_the_areas_inside_all_cells_of_a_depth_are_the_area_of_the_scene(self, spec: str) -> None:
        mesh = soup("soup", 60)
        corners = mesh.vertices[mesh.faces]
        tree = neutral_tree(mesh, parse_spec(f"{spec}:intersection_cost=2"))
        subtrees = normals.Subtrees(tree)
        leaves = np.flatnonzero(tree.is_leaf)
        total = 0.0
        for leaf in leaves:
            inside = corners[subtrees.triangles(leaf)]
            assert len(inside) == tree.count[leaf]
            total += normals._areas_inside(tree, leaf, inside).sum()
        assert len(leaves) > 5
        assert total == pytest.approx(work.normals_and_areas(corners)[1].sum(), rel=1e-5)

    def test_subtrees(self) -> None:
        mesh = soup("soup", 60)
        tree = neutral_tree(mesh, parse_spec("kd:intersection_cost=2"))
        subtrees = normals.Subtrees(tree)
        assert len(subtrees.triangles(0)) == 60
        assert subtrees.heaviest(0) == 0 and subtrees.depths[subtrees.heaviest(2)] == 2
        assert subtrees.inner_below(0, 1).tolist() == [0]
        assert (subtrees.depths[subtrees.inner_below(0, 3)] < 3).all()
        node = subtrees.heaviest(3)
        path = normals.path_to(tree, node)
        assert len(path) == 3 and path[0][0] == 0
        ends = [int(tree.above[at]) if above else at + 1 for at, above in path]
        assert ends == [*(at for at, _ in path[1:]), node]

    def test_the_map_keeps_areas(self) -> None:
        """Directions that are uniform on the sphere are uniform on the disc."""
        u, v = qmc.Sobol(2, rng=0).random(2**15).T
        z, angle = 1 - 2 * u, 2 * np.pi * v
        points = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
        radius = np.linalg.norm(normals.project(points), axis=1)
        assert radius.max() <= 1 + 1e-9
        for r in (0.25, 0.5, 0.75):
            assert (radius < r).mean() == pytest.approx(r * r, abs=0.003)
        assert normals.project(-points) == pytest.approx(normals.project(points))

    def test_what_lies_on_the_rim_is_on_both_of_its_sides(self) -> None:
        shares = normals._map(np.array([[1.0, 0, 0], [0, 0, 1]]), np.array([2.0, 6.0]))
        assert shares.sum() == pytest.approx(1)
        middle = normals.BINS // 2
        assert shares[-1, middle] == shares[0, middle] == pytest.approx(0.125)
        assert shares[middle, middle] == pytest.approx(0.75)

    def test_measure(self, scene: Path) -> None:
        job = Job("normals", str(scene), "scalar_rgb", "kd:intersection_cost=9", arrays=str(scene.with_name("n.npz")))
        found = normals.measure(job, lambda _: None)
        assert found["oblique_share"] == 0 and found["interior_nodes"] > 3 and 0 <= found["parallel_share"] <= 1
        assert [node["depth"] for node in found["nodes"]][0] == 0 and found["nodes"][0]["triangles"] == 30
        with np.load(scene.with_name("n.npz")) as arrays:
            assert arrays["map0"].sum() == pytest.approx(1, abs=1e-5)
            assert len(arrays["directions0"]) == len(arrays["depths0"]) > 3


class TestSlice:
    """Cross-sections."""

    @pytest.mark.parametrize("spec", ["kd", "rbsp", "normals", "ize"])
    @pytest.mark.parametrize("plane", [[0, 0, 1, 0.1], [1, 2, -1, 0.3]])
    def test_cells_cover_the_section_once(self, spec: str, plane: list[float]) -> None:
        tree = neutral_tree(soup("soup", 80), parse_spec(f"{spec}:intersection_cost=2"))
        plane = np.array(plane) / np.linalg.norm(plane[:3])
        cells, leaves = cross_section.section(tree, plane)
        assert np.abs(cells.astype(float) @ plane[:3] - plane[3]).max() < 1e-9 and tree.is_leaf[leaves].all()
        across = cross_section.basis(plane)
        areas = cross_section._areas((cells @ across.T.astype(np.longdouble)).astype(float))
        whole = cross_section._areas(
            (cross_section._box_part(plane, tree.box) @ across.T.astype(np.longdouble)).astype(float)
        )
        assert areas.sum() == pytest.approx(whole.sum(), rel=1e-9) and len(leaves) > 3

    def test_a_point_of_the_section_is_in_the_cell_of_its_leaf(self) -> None:
        tree = neutral_tree(soup("soup", 80), parse_spec("normals:intersection_cost=2"))
        cells, leaves = cross_section.section(tree, np.array([0, 0, 1, 0.1]))
        for cell, leaf in zip(cells.astype(float), leaves, strict=True):
            node, middle = 0, np.unique(cell.round(12), axis=0).mean(axis=0)
            while not tree.is_leaf[node]:
                above = tree.normals[node] @ middle > tree.offsets[node]
                node = int(tree.above[node]) if above else node + 1
            assert node == leaf

    def test_the_outline_of_a_sphere(self) -> None:
        ball = sphere("ball", 40)
        segments = cross_section.outline(ball.vertices[ball.faces].astype(float), np.array([0, 1, 0, 1.0]))
        lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
        assert lengths.sum() == pytest.approx(2 * np.pi * np.sqrt(3), rel=0.01)
        assert np.linalg.norm(segments, axis=2) == pytest.approx(2, rel=0.01)

    def test_two_steps_and_a_leaf_have_a_cost(self) -> None:
        spec = parse_spec("normals:node_cost=0,axis_cost=1,oblique_cost=2,leaf_cost=3,intersection_cost=5")
        tree = neutral_tree(soup("soup", 40), spec)
        costs = cross_section.leaf_costs(tree, spec)
        leaf = int(np.flatnonzero(tree.is_leaf & (tree.count > 0))[3])
        oblique = [(tree.normals[node] != 0).sum() > 1 for node, _ in normals.path_to(tree, leaf)]
        steps = sum(2 if slanted else 1 for slanted in oblique)
        assert costs[leaf] == steps + 3 + 5 * tree.count[leaf]
        empty = np.flatnonzero(tree.is_leaf & (tree.count == 0))
        assert all(costs[e] <= 2 * len(normals.path_to(tree, e)) for e in empty)

    def test_the_first_planes_lie_in_the_box(self) -> None:
        tree = neutral_tree(soup("soup", 80), parse_spec("normals:intersection_cost=2,axes=none"))
        found = cross_section.first_planes(tree, tree.box)
        assert len(found["planes"]) == len(found["levels"]) == len(found["oblique"]) > 5
        assert found["levels"].max() == cross_section.PLANE_LEVELS - 1 and found["oblique"].all()
        slack = 1e-4
        inside = (found["planes"] >= tree.box[0] - slack) & (found["planes"] <= tree.box[1] + slack)
        assert inside.all()

    def test_a_scene_without_splits(self) -> None:
        one = Mesh("one", np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32))
        tree = neutral_tree(one, parse_spec("kd"))
        assert len(cross_section.first_planes(tree, tree.box)["planes"]) == 0
        cells, leaves = cross_section.section(tree, np.array([1, 0, 0, 0.5]))
        assert leaves.tolist() == [0] and len(cells) == 1

    def test_the_default_plane_meets_most_triangles(self) -> None:
        flat = np.array([[[x, 0, 0], [x + 1, 0, 0], [x, 1, 0.1]] for x in range(10)], float)
        assert cross_section.default_plane(flat) == [0.0, 1.0, 0.0, 0.5]

    def test_a_floor_without_end_is_not_shown(self) -> None:
        ball = sphere("ball", 40)
        corners = ball.vertices[ball.faces].astype(float)
        low, high = cross_section.shown_box(corners)
        assert low.tolist() == corners.min(axis=(0, 1)).tolist() and high.tolist() == corners.max(axis=(0, 1)).tolist()
        floor = np.array([[[-1e3, -1e3, -2], [1e3, -1e3, -2], [0, 1e3, -2]]])
        both = np.concatenate([corners, floor])
        low, high = cross_section.shown_box(both)
        assert np.abs([low, high]).max() < 2.5 and low[2] == -2
        assert np.abs(cross_section.default_plane(both)[3]) < 0.1
        points = cross_section.surface_points(both, np.stack([low, high]))
        assert (points >= low - 1e-5).all() and (points <= high + 1e-5).all() and (points[:, 2] == -2).mean() > 0.1

    def test_the_first_planes_are_those_that_part_the_triangles(self) -> None:
        ball = sphere("ball", 40)
        corners = np.array([[-1e3, -1e3, -3], [1e3, -1e3, -3], [0, 1e3, -3]], np.float32)
        floor = np.arange(3, dtype=np.uint32)[None] + len(ball.vertices)
        both = Mesh("both", np.concatenate([ball.vertices, corners]), np.concatenate([ball.faces, floor]))
        tree = neutral_tree(both, parse_spec("kd"))
        box = cross_section.shown_box(both.vertices[both.faces].astype(float))
        found = cross_section.first_planes(tree, box)
        first = found["planes"][found["levels"] == 0]
        assert len(first) == 1 and np.abs(first[0].mean(axis=0)).max() < 1.5

    def test_measure(self, scene: Path) -> None:
        arrays = str(scene.with_name("s.npz"))
        choices = {"plane": [0, 0, 2, 0.6]}
        job = Job("slice", str(scene), "scalar_rgb", "rbsp:intersection_cost=9", arrays=arrays, choices=choices)
        found = cross_section.measure(job, lambda _: None)
        assert found["plane"] == [0, 0, 1, 0.3] and found["cells"] > 1
        with np.load(arrays) as kept:
            assert len(kept["cells"]) == len(kept["depth"]) == len(kept["cost"]) == found["cells"]
            span = np.ptp(kept["cells"].reshape(-1, 2), axis=0)
            assert span[0] >= span[1] and kept["points"].shape[1] == 3

    @pytest.mark.parametrize("plane", [[1, 0, 0, 1000], [0, 0, -2, 9], [1, 1, 1, -4], [0, 0, 1, -1], [0, 0, 1, 1]])
    def test_a_plane_beside_the_scene(self, tmp_path: Path, plane: list[float]) -> None:
        """Or one that touches it at its end: a cube of side 2."""
        cube = tmp_path / "cube.xml"
        cube.write_text('<scene version="3.0.0"><shape type="cube"/></scene>')
        job = Job("slice", str(cube), "scalar_rgb", "kd", arrays=str(tmp_path / "s.npz"), choices={"plane": plane})
        with pytest.raises(
            ValueError, match=r"does not cut the scene, which reaches from -\d.* to \d.* along the"
        ) as raised:
            cross_section.measure(job, lambda _: None)
        assert str(raised.value).startswith("the plane (") and not (tmp_path / "s.npz").exists()

    @pytest.mark.parametrize("spec", ["kd", "normals", "kd:orientation=scene"])
    @pytest.mark.parametrize("plane", [[0, 0, 1, 0.999999], [1, 1, 1, -2.9999999], [1, 1, 0, 1.9]])
    def test_a_plane_that_just_cuts_the_scene(self, tmp_path: Path, spec: str, plane: list[float]) -> None:
        cube = tmp_path / "cube.xml"
        cube.write_text('<scene version="3.0.0"><shape type="cube"/></scene>')
        job = Job("slice", str(cube), "scalar_rgb", spec, arrays=str(tmp_path / "s.npz"), choices={"plane": plane})
        try:
            assert cross_section.measure(job, lambda _: None)["cells"] > 0
        except ValueError as error:
            assert "does not cut the scene" in str(error)

    def test_a_flat_scene_may_lie_in_the_plane(self, tmp_path: Path) -> None:
        floor = tmp_path / "floor.xml"
        floor.write_text('<scene version="3.0.0"><shape type="rectangle"/></scene>')
        choices = {"plane": [0, 0, 1, 0]}
        job = Job("slice", str(floor), "scalar_rgb", "kd", arrays=str(tmp_path / "s.npz"), choices=choices)
        assert cross_section.measure(job, lambda _: None)["cells"] > 0

    def test_nothing_is_left_of_a_section_beside_the_tree(self) -> None:
        tree = neutral_tree(soup("soup", 20), parse_spec("kd:intersection_cost=2"))
        cells, leaves = cross_section.section(tree, np.array([1, 0, 0, 1000.0]))
        assert len(cells) == len(leaves) == 0


class TestConvergence:
    """Errors against time."""

    def test_errors_of_known_images(self) -> None:
        reference = np.full((16, 16, 3), 0.5)
        assert convergence.errors(reference, reference) == {"relmse": 0.0, "flip": pytest.approx(0, abs=1e-6)}
        off = convergence.errors(reference * 1.2, reference)
        assert off["relmse"] == pytest.approx(0.01 / (0.25 + convergence.EPSILON)) and off["flip"] > 0

    def test_the_time_to_an_error_is_interpolated_on_logarithmic_axes(self) -> None:
        points = [
            {"seconds": 1.0, "relmse": 1.0},
            {"seconds": 4.0, "relmse": 0.25},
            {"seconds": 16.0, "relmse": 0.0625},
        ]
        assert convergence.time_to_reach(points, 0.125) == pytest.approx(8)
        assert convergence.time_to_reach(points, 2.0) == 1.0
        assert convergence.time_to_reach(points, 0.01) is None

    def test_all_reach_the_error_that_is_asked_for(self) -> None:
        """Also those whose last error is larger than the others', by rounding alone."""
        ends = {"native": 0.125, "kd": 0.1250001}
        points = {tree: [{"passes": 1, "seconds": 1.0, "relmse": 0.5, "flip": None}] for tree in ends}
        for tree, end in ends.items():
            points[tree].append({"passes": 4, "seconds": 4.0, "relmse": end, "flip": None})
        common = {"scene": "s", "measure": "converge", "repeat": 0, "triangles": 12, "resolution": (8, 8), "spp": 1}
        rows = [{**common, "tree": tree, "spec": tree, "build_s": 0.5, "points": points[tree]} for tree in ends]
        (table,) = convergence.tables(rows)
        assert [(row[0], row[-2]) for row in table.rows] == [("native", "4.00"), ("kd", "4.00")]

    def test_passes_converge_alike_under_all(self, room: Path, tmp_path: Path) -> None:
        choices = {"passes": 6, "reference_passes": 40}
        found = {}
        for spec in ("kd", "normals", "native"):
            fields = {
                "spp": 2,
                "resolution": 16,
                "choices": choices,
                "arrays": str(tmp_path / "converge" / f"{spec}.npz"),
            }
            found[spec] = convergence.measure(Job("converge", str(room), "scalar_rgb", spec, **fields), lambda _: None)
        points = found["kd"]["points"]
        assert [point["passes"] for point in points] == [1, 2, 4, 6]
        assert points[-1]["relmse"] < points[0]["relmse"] / 2
        seconds = [point["seconds"] for point in points]
        assert found["kd"]["build_s"] < seconds[0] and seconds == sorted(seconds)
        assert [p["relmse"] for p in points] == [p["relmse"] for p in found["normals"]["points"]]
        assert points[-1]["relmse"] == pytest.approx(found["native"]["points"][-1]["relmse"], rel=0.05)
        with np.load(tmp_path / "converge" / "kd.npz") as arrays:
            assert set(arrays) == {"1", "2", "4", "6"} and arrays["6"].shape == (16, 16, 3)
