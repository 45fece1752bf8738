/// The input of every accelerator: triangles with stable ids, the invalid ones set aside.
#pragma once

#include <cstdint>
#include <vector>

#include "scale.h"
#include "vec.h"

namespace bsp {

struct Triangle {
    Vec3f a, b, c;

    float operator()(unsigned corner, unsigned axis) const { return (&a)[corner][axis]; }
};

/// An axis-aligned box in double precision; empty when `lower > upper`.
struct Bounds {
    Vec3d lower{HUGE_VAL, HUGE_VAL, HUGE_VAL};
    Vec3d upper{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};

    void extend(const Vec3d &p);
    Vec3d corner(unsigned index) const; ///< one of eight
    bool empty() const { return !(lower.x <= upper.x); }
};

/// Triangles numbered from 0 in the order they were added. A triangle with a vertex that is not finite, or without
/// area, keeps its id but is not in `valid`, so that it is never built into a tree and never hit.
struct TriangleSet {
    std::vector<Triangle> triangles;
    std::vector<std::uint32_t> valid; ///< ids of the usable triangles, ascending
    std::vector<Bounds> primitives;   ///< boxes of what is no triangle, see primitives.h
    Bounds bounds;                    ///< of the usable triangles and the primitives
    Scale scale;                      ///< of all coordinates here, bounds included, against the user's

    /// Appends `face_count` triangles. `vertices` holds 3 floats per vertex, `faces` 3 indices per triangle.
    /// Throws std::out_of_range, naming triangle, index and vertex count, if an index has no vertex, and
    /// std::length_error if there would be more than 2^31 triangles. Nothing is added if it throws.
    void add(const float *vertices, std::size_t vertex_count, const std::uint32_t *faces, std::size_t face_count);

    /// Appends a primitive, by its box, which is not empty and finite and grows to the next floats. Throws
    /// std::length_error if there would be 2^31.
    void add_primitive(const Bounds &box);

    /// Brings coordinates near 1. To be called at most once, when all has been added. A coordinate whose
    /// counterpart is no normal float, being 2^126 times smaller than the largest, may lose digits.
    void rescale();
    Bounds user_bounds() const; ///< in the user's units

    std::size_t size() const { return valid.size() + primitives.size(); } ///< what a tree has to list
    std::size_t dropped() const { return triangles.size() - valid.size(); }
};

/// The geometric normal, not normalised: its length is twice the area.
Vec3d scaled_normal(const Triangle &triangle);

} // namespace bsp
