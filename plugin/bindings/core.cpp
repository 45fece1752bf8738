/// The Python extension over the core: trees from arrays, rays from arrays, statistics. No Mitsuba here.
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "builder.h"
#include "choice.h"
#include "replay.h"
#include "settings.h"
#include "tree.h"

#if defined(__clang__)
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "g++ " __VERSION__
#endif

namespace nb = nanobind;
using namespace nb::literals;
using namespace bindings;

namespace {

nb::dict to_dict(const std::vector<std::pair<std::string, bsp::SettingValue>> &settings) {
    nb::dict result;
    for (const auto &[name, value] : settings)
        result[name.c_str()] = nb::cast(value);
    return result;
}

/// What Python holds.
struct Tree {
    std::unique_ptr<bsp::Accelerator> accelerator;

    Tree(const Rows3 &vertices, const Faces &faces, const std::string &tree, const OptionMap &options,
         const std::string &fault, const std::string &cache)
        : accelerator(build(vertices, faces, tree, options, fault, cache)) {}
};

nb::dict closest(const Tree &tree, Rows3 origins, Rows3 directions, Values maxt) {
    const RayArrays rays(std::move(origins), std::move(directions), std::move(maxt));
    std::vector<float> t(rays.size()), u(rays.size()), v(rays.size());
    std::vector<std::uint32_t> triangle(rays.size());
    for_each_ray(rays, [&](std::size_t i, const bsp::Ray &ray) {
        const bsp::Hit hit = tree.accelerator->closest(ray);
        t[i] = hit.t;
        u[i] = hit.u;
        v[i] = hit.v;
        triangle[i] = hit.triangle;
    });
    nb::dict result;
    result["t"] = to_numpy(std::move(t));
    result["u"] = to_numpy(std::move(u));
    result["v"] = to_numpy(std::move(v));
    result["triangle"] = to_numpy(std::move(triangle));
    return result;
}

nb::ndarray<nb::numpy, std::uint8_t> any(const Tree &tree, Rows3 origins, Rows3 directions, Values maxt) {
    const RayArrays rays(std::move(origins), std::move(directions), std::move(maxt));
    std::vector<std::uint8_t> found(rays.size());
    for_each_ray(rays, [&](std::size_t i, const bsp::Ray &ray) { found[i] = tree.accelerator->any(ray); });
    return to_numpy(std::move(found));
}

nb::dict count(const Tree &tree, Rows3 origins, Rows3 directions, Values maxt, bool any_hit) {
    const RayArrays rays(std::move(origins), std::move(directions), std::move(maxt));
    return count_rays(rays, [&](const bsp::Ray &ray, bsp::Counters &counters) {
        if (any_hit)
            tree.accelerator->count_any(ray, counters);
        else
            tree.accelerator->count_closest(ray, counters);
    });
}

nb::tuple time_rays(const Tree &tree, Rows3 origins, Rows3 directions, Values maxt, bool any_hit) {
    const RayArrays rays(std::move(origins), std::move(directions), std::move(maxt));
    if (any_hit)
        return replay(rays, [&](const bsp::Ray &ray) { return float(tree.accelerator->any(ray)); });
    return replay(rays, [&](const bsp::Ray &ray) { return tree.accelerator->closest(ray).t; });
}

/// The accelerator's memory as read-only arrays, which keep the tree alive.
nb::list memory(nb::handle self) {
    nb::list parts;
    for (const bsp::MemoryPart &part : nb::cast<const Tree &>(self).accelerator->memory())
        parts.append(nb::ndarray<nb::numpy, const std::uint8_t>(part.data, {part.size}, self));
    return parts;
}

/// Planes considered and different planes, per level and (last) of the whole tree.
nb::list survey_planes(const Rows3 &vertices, const Faces &faces, const std::string &tree, const OptionMap &options) {
    const bsp::Settings settings = bsp::make_settings(tree, to_options(options));
    bsp::TriangleSet set = to_triangles(vertices, faces);
    set.rescale();
    nb::list result;
    for (const bsp::LevelPlanes &level : watched([&](bsp::BuildMonitor &monitor) {
             return bsp::survey_planes(set, bsp::choose_tree(set, settings, &monitor).settings, &monitor);
         }))
        result.append(nb::make_tuple(level.considered, level.different));
    return result;
}

/// All split planes: (p, 4) rows of normal and offset, flat.
nb::ndarray<nb::numpy, float> planes(const Tree &tree) {
    std::vector<float> rows;
    for (const bsp::Plane &plane : tree.accelerator->planes())
        rows.insert(rows.end(), {plane.normal.x, plane.normal.y, plane.normal.z, plane.offset});
    return to_numpy(std::move(rows));
}

/// The neutral tree before it is packed, for audits: an array entry a node, depth first, and the leaves' triangles.
/// Planes and box are as seen in its axes.
nb::dict neutral_tree(const Rows3 &vertices, const Faces &faces, const std::string &tree_name,
                      const OptionMap &options) {
    const bsp::Settings settings = bsp::make_settings(tree_name, to_options(options));
    const bsp::TriangleSet set = to_triangles(vertices, faces);
    bsp::Tree tree;
    {
        nb::gil_scoped_release release;
        tree = bsp::build_tree(set, bsp::choose_tree(set, settings).settings);
    }
    std::vector<std::uint8_t> is_leaf;
    std::vector<float> planes;
    std::vector<std::uint32_t> above, first, count;
    for (const bsp::TreeNode &node : tree.nodes) {
        const bsp::Direction &direction = node.direction;
        float normal[3] = {};
        normal[direction.major] = 1;
        normal[bsp::next_axis[direction.major]] = direction.a;
        normal[bsp::after_axis[direction.major]] = direction.b;
        is_leaf.push_back(node.kind == bsp::TreeNode::Kind::leaf);
        planes.insert(planes.end(), {normal[0], normal[1], normal[2], node.offset});
        above.push_back(node.above);
        first.push_back(node.first);
        count.push_back(node.count);
    }
    const bsp::Bounds &box = tree.box;
    nb::dict result;
    result["is_leaf"] = to_numpy(std::move(is_leaf));
    result["planes"] = to_numpy(std::move(planes));
    result["above"] = to_numpy(std::move(above));
    result["first"] = to_numpy(std::move(first));
    result["count"] = to_numpy(std::move(count));
    result["references"] = to_numpy(std::move(tree.references));
    result["box"] = to_numpy(std::vector<double>{box.lower.x, box.lower.y, box.lower.z, //
                                                 box.upper.x, box.upper.y, box.upper.z});
    std::vector<double> axes;
    for (const bsp::Vec3d &axis : tree.orientation.axes())
        axes.insert(axes.end(), {axis.x, axis.y, axis.z});
    const bsp::Vec3d origin = tree.orientation.origin();
    result["axes"] = to_numpy(std::move(axes));
    result["origin"] = to_numpy(std::vector<double>{origin.x, origin.y, origin.z});
    result["plane_tolerance"] = tree.plane_tolerance;
    result["depth"] = tree.depth;
    return result;
}

#if defined(BSP_MISTAKES)
/// A float beyond the end of an array.
float read_too_far() {
    const std::vector<float> values(8, 1.0F);
    const volatile std::size_t size = values.size();
    return values.data()[size] + 1;
}

int overflow() {
    volatile int largest = std::numeric_limits<int>::max();
    return largest + 1;
}

/// Tasks that write to the same place; each takes its time, so that they are on different threads.
int race() {
    int shared = 0;
    bsp::parallel_for(8, 1, [&](std::size_t begin, std::size_t) {
        shared += int(begin);
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    });
    return shared;
}

/// By a number that was never written.
int decide_by_nothing() {
    const std::unique_ptr<int[]> values(new int[8]);
    const volatile int *const place = values.get();
    volatile int decision = 1;
    if (*place > 0)
        decision = 2;
    return decision;
}
#endif

} // namespace

NB_MODULE(_core, m) {
    m.doc() = "Trees and rays without a renderer; mitsuba_bsp.Accelerator is the public face of it.";

    m.attr("compiler") = COMPILER;
    m.def("trees", &bsp::tree_names);
    m.def("faults", &bsp::fault_names);
    m.def("survey_planes", &survey_planes, "vertices"_a, "faces"_a, "tree"_a, "options"_a);
    m.def("neutral_tree", &neutral_tree, "vertices"_a, "faces"_a, "tree"_a, "options"_a);
    m.def(
        "settings",
        [](const std::string &tree, const OptionMap &options) {
            return to_dict(bsp::list_settings(bsp::make_settings(tree, to_options(options))));
        },
        "tree"_a, "options"_a);
    m.def(
        "settings_help",
        [](const std::string &tree) {
            nb::list list;
            for (const bsp::SettingHelp &help : bsp::settings_help(tree)) {
                nb::dict entry;
                entry["name"] = help.name;
                entry["values"] = help.values;
                entry["meaning"] = help.meaning;
                entry["default"] = nb::cast(help.default_value);
                list.append(entry);
            }
            return list;
        },
        "tree"_a);

    m.def(
        "traits",
        [](const std::string &tree, const OptionMap &options) {
            const bsp::TreeTraits traits = bsp::traits_of(bsp::make_settings(tree, to_options(options)));
            nb::dict result;
            result["planes"] = traits.planes;
            result["from_triangles"] = traits.from_triangles;
            result["drawn"] = traits.drawn;
            result["planes_per_triangle"] = traits.planes_per_triangle;
            result["recurring_per_triangle"] = traits.recurring_per_triangle;
            return result;
        },
        "tree"_a, "options"_a);

    nb::class_<Tree>(m, "Accelerator")
        .def(nb::init<const Rows3 &, const Faces &, const std::string &, const OptionMap &, const std::string &,
                      const std::string &>(),
             "vertices"_a, "faces"_a, "tree"_a = "kd", "options"_a = OptionMap(), "fault"_a = "", "cache"_a = "")
        .def("closest", &closest, "origins"_a, "directions"_a, "maxt"_a)
        .def("any", &any, "origins"_a, "directions"_a, "maxt"_a)
        .def("count", &count, "origins"_a, "directions"_a, "maxt"_a, "any_hit"_a = false)
        .def("time", &time_rays, "origins"_a, "directions"_a, "maxt"_a, "any_hit"_a = false)
        .def("memory", &memory)
        .def("statistics", [](const Tree &tree) { return bsp::to_json(tree.accelerator->statistics()); })
        .def("warning", [](const Tree &tree) { return tree.accelerator->statistics().warning; })
        .def("planes", &planes);

#if defined(BSP_MISTAKES)
    // For sanitizers to report: one that does not is blind.
    nb::module_ mistakes = m.def_submodule("mistakes");
    mistakes.def("read_too_far", &read_too_far);
    mistakes.def("overflow", &overflow);
    mistakes.def("race", &race);
    mistakes.def("decide_by_nothing", &decide_by_nothing);
#endif
}
