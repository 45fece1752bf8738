/// Rays from NumPy arrays and answers to NumPy arrays, for every accelerator that Python can ask.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "parallel.h"
#include "ray.h"

namespace bindings {

namespace nb = nanobind;

using Rows3 = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Faces = nb::ndarray<const std::uint32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

constexpr std::size_t rays_per_task = 128;

/// A NumPy array that owns `values`.
template <typename T> nb::ndarray<nb::numpy, T> to_numpy(std::vector<T> values) {
    auto *owned = new std::vector<T>(std::move(values));
    nb::capsule owner(owned, [](void *p) noexcept { delete static_cast<std::vector<T> *>(p); });
    return nb::ndarray<nb::numpy, T>(owned->data(), {owned->size()}, owner);
}

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

/// What rays cost, one entry a ray. `trace(ray, counters)` counts one.
template <typename Trace> nb::dict count_rays(const RayArrays &rays, const Trace &trace) {
    std::vector<std::uint64_t> axis_steps(rays.size()), oblique_steps(rays.size()), leaves(rays.size()),
        tests(rays.size());
    for_each_ray(rays, [&](std::size_t i, const bsp::Ray &ray) {
        bsp::Counters counters;
        trace(ray, counters);
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

} // namespace bindings
