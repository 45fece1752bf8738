/// A tree from NumPy arrays: what the Python extensions build.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "../interrupt.h"
#include "accelerator.h"
#include "faults.h"
#include "ray_arrays.h"

namespace bindings {

using OptionMap = std::map<std::string, std::string>;

inline bsp::Options to_options(const OptionMap &options) { return {options.begin(), options.end()}; }

inline bsp::TriangleSet to_triangles(const Rows3 &vertices, const Faces &faces) {
    bsp::TriangleSet set;
    set.add(vertices.data(), vertices.shape(0), faces.data(), faces.shape(0));
    return set;
}

/// `build(monitor)`, without Python's lock and until Ctrl-C.
template <typename Build> auto watched(const Build &build) {
    try {
        nb::gil_scoped_release release;
        bsp::BuildMonitor monitor;
        const InterruptWatch watch(monitor);
        return build(monitor);
    } catch (const bsp::BuildCancelled &) {
        if (PyErr_CheckSignals() != 0)
            throw nb::python_error();
        throw;
    }
}

/// Builds a tree; `fault`: as for `bsp::make_faulty_accelerator`, empty for none.
inline std::unique_ptr<bsp::Accelerator> build(const Rows3 &vertices, const Faces &faces, const std::string &tree,
                                               const OptionMap &options, const std::string &fault,
                                               const std::string &cache) {
    const bsp::Settings settings = bsp::make_settings(tree, to_options(options));
    bsp::TriangleSet set = to_triangles(vertices, faces);
    return watched([&](bsp::BuildMonitor &monitor) {
        return fault.empty() ? bsp::make_accelerator(std::move(set), settings, {cache, &monitor})
                             : bsp::make_faulty_accelerator(std::move(set), settings, fault);
    });
}

} // namespace bindings
