/// The Python extension over the core: trees from arrays, rays from arrays, statistics. No Mitsuba here.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "../interrupt.h"
#include "accelerator.h"
#include "builder.h"
#include "faults.h"
#include "parallel.h"
#include "settings.h"

#if defined(__clang__)
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "g++ " __VERSION__
#endif

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Rows3 = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Faces = nb::ndarray<const std::uint32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

constexpr std::size_t rays_per_task = 1024;

/// A NumPy array that owns `values`.
template <typename T> nb::ndarray<nb::numpy, T> to_numpy(std::vector<T> values) {
    auto *owned = new std::vector<T>(std::move(values));
    nb::capsule owner(owned, [](void *p) noexcept { delete static_cast<std::vector<T> *>(p); });
    return nb::ndarray<nb::numpy, T>(owned->data(), {owned->size()}, owner);
}

bsp::Options to_options(const std::map<std::string, std::string> &options) { return {options.begin(), options.end()}; }

nb::dict to_dict(const std::vector<std::pair<std::string, bsp::SettingValue>> &settings) {
    nb::dict result;
    for (const auto &[name, value] : settings)
        result[name.c_str()] = nb::cast(value);
    return result;
}

bsp::TriangleSet to_triangles(const Rows3 &vertices, const Faces &faces) {
    bsp::TriangleSet set;
    set.add(vertices.data(), vertices.shape(0), faces.data(), faces.shape(0));
    return set;
}

/// What Python holds.
struct Tree {
    std::unique_ptr<bsp::Accelerator> accelerator;

    Tree(const Rows3 &vertices, const Faces &faces, const std::string &tree,
         const std::map<std::string, std::string> &options, const std::string &fault, const std::string &cache) {
        const bsp::Settings settings = bsp::make_settings(tree, to_options(options));
        const bsp::TriangleSet set = to_triangles(vertices, faces);
        try {
            nb::gil_scoped_release release;
            bsp::BuildMonitor monitor;
            const InterruptWatch watch(monitor);
            accelerator = fault.empty() ? bsp::make_accelerator(set, settings, {cache, &monitor})
                                        : bsp::make_faulty_accelerator(set, settings, fault);
        } catch (const bsp::BuildCancelled &) {
            if (PyErr_CheckSignals() != 0)
                throw nb::python_error();
            throw;
        }
    }
};

/// Rays given as arrays: (r, 3) origins, (r, 3) directions, (r,) ends.
class RayArrays {
public:
    RayArrays(Rows3 origins, Rows3 directions, Values maxt)
        : m_origins(std::move(origins)), m_directions(std::move(directions)), m_maxt(std::move(maxt)) {
        if (m_directions.shape(0) != size() || m_maxt.shape(0) != size())
            throw std::invalid_argument("there are " + std::to_string(size()) + " origins, " +
                                        std::to_string(m_directions.shape(0)) + " directions and " +
                                        std::to_string(m_maxt.shape(0)) + " values of maxt: the numbers must be equal");
    }

    std::size_t size() const { return m_origins.shape(0); }

    bsp::Ray operator[](std::size_t i) const {
        const float *o = m_origins.data() + 3 * i, *d = m_directions.data() + 3 * i;
        return {{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, m_maxt.data()[i]};
    }

private:
    Rows3 m_origins, m_directions;
    Values m_maxt;
};

/// Calls `trace(i, ray)` for every ray, on all threads, in the floating-point environment of the standard.
template <typename Trace> void for_each_ray(const RayArrays &rays, const Trace &trace) {
    nb::gil_scoped_release release;
    bsp::parallel_for(rays.size(), rays_per_task, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            trace(i, rays[i]);
    });
}

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
    std::vector<std::uint64_t> axis_steps(rays.size()), oblique_steps(rays.size()), leaves(rays.size()),
        tests(rays.size());
    for_each_ray(rays, [&](std::size_t i, const bsp::Ray &ray) {
        bsp::Counters counters;
        if (any_hit)
            tree.accelerator->count_any(ray, counters);
        else
            tree.accelerator->count_closest(ray, counters);
        axis_steps[i] = counters.axis_steps;
        oblique_steps[i] = counters.oblique_steps;
        leaves[i] = counters.leaves;
        tests[i] = counters.triangle_tests;
    });
    nb::dict result;
    result["axis_steps"] = to_numpy(std::move(axis_steps));
    result["oblique_steps"] = to_numpy(std::move(oblique_steps));
    result["leaves_visited"] = to_numpy(std::move(leaves));
    result["triangle_tests"] = to_numpy(std::move(tests));
    return result;
}

/// Planes considered and different planes, per level and (last) of the whole tree.
nb::list survey_planes(const Rows3 &vertices, const Faces &faces, const std::string &tree,
                       const std::map<std::string, std::string> &options) {
    const bsp::Settings settings = bsp::make_settings(tree, to_options(options));
    const bsp::TriangleSet set = to_triangles(vertices, faces);
    std::vector<bsp::LevelPlanes> levels;
    {
        nb::gil_scoped_release release;
        levels = bsp::survey_planes(set, settings);
    }
    nb::list result;
    for (const bsp::LevelPlanes &level : levels)
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

} // namespace

NB_MODULE(_core, m) {
    m.doc() = "Trees and rays without a renderer; mitsuba_bsp.Accelerator is the public face of it.";

    m.attr("compiler") = COMPILER;
    m.def("trees", &bsp::tree_names);
    m.def("faults", &bsp::fault_names);
    m.def("survey_planes", &survey_planes, "vertices"_a, "faces"_a, "tree"_a, "options"_a);
    m.def(
        "settings",
        [](const std::string &tree, const std::map<std::string, std::string> &options) {
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

    nb::class_<Tree>(m, "Accelerator")
        .def(nb::init<const Rows3 &, const Faces &, const std::string &, const std::map<std::string, std::string> &,
                      const std::string &, const std::string &>(),
             "vertices"_a, "faces"_a, "tree"_a = "kd", "options"_a = std::map<std::string, std::string>(),
             "fault"_a = "", "cache"_a = "")
        .def("closest", &closest, "origins"_a, "directions"_a, "maxt"_a)
        .def("any", &any, "origins"_a, "directions"_a, "maxt"_a)
        .def("count", &count, "origins"_a, "directions"_a, "maxt"_a, "any_hit"_a = false)
        .def("statistics", [](const Tree &tree) { return bsp::to_json(tree.accelerator->statistics()); })
        .def("warning", [](const Tree &tree) { return tree.accelerator->statistics().warning; })
        .def("planes", &planes);
}
