/// Where a ray that just misses a triangle comes nearest to it.
///
/// A hit is found with one ray and described with another if the shape is instanced: Embree and Mitsuba's `instance`
/// turn the ray into the instance's space each in its own way. The second may just miss the triangle that the first has
/// hit.
#pragma once

#include <mitsuba/core/ray.h>

#include <algorithm>

#include "../core/vec.h"

NAMESPACE_BEGIN(mitsuba)

/// Weights of the second and third corner, inside the triangle whatever happens.
template <typename Ray> Point<float, 2> nearest_weights(const bsp::Vec3f (&corners)[3], const Ray &ray) {
    const bsp::Vec3d a = to_double(corners[0]), e1 = to_double(corners[1]) - a, e2 = to_double(corners[2]) - a;
    const bsp::Vec3d o{ray.o.x(), ray.o.y(), ray.o.z()}, d{ray.d.x(), ray.d.y(), ray.d.z()};
    const bsp::Vec3d n = cross(e1, e2), p = o + d * (dot(a - o, n) / dot(d, n)) - a;
    const double scale = 1 / dot(n, n);
    const auto between = [](double x, double end) { return x > 0 ? std::min(x, end) : 0.0; }; // 0 if not a number
    const double u = between(dot(cross(p, e2), n) * scale, 1.0);
    const double v = between(dot(cross(e1, p), n) * scale, 1.0 - u);
    return Point<float, 2>(float(u), float(v));
}

NAMESPACE_END(mitsuba)
