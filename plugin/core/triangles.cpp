#include "triangles.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "sorting.h"
#include "standard_floats.h"

namespace bsp {

void Bounds::extend(const Vec3d &p) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        lower[axis] = std::min(lower[axis], p[axis]);
        upper[axis] = std::max(upper[axis], p[axis]);
    }
}

Vec3d Bounds::corner(unsigned index) const {
    return {index & 1 ? upper.x : lower.x, index & 2 ? upper.y : lower.y, index & 4 ? upper.z : lower.z};
}

Vec3d scaled_normal(const Triangle &t) {
    const Vec3d a = to_double(t.a);
    return cross(to_double(t.b) - a, to_double(t.c) - a);
}

namespace {

bool is_finite(const Vec3f &v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

double largest_of(const Vec3d &v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

/// Whether the exact sum is 0: the terms become numbers of the same sum whose digits do not overlap (Shewchuk 1997).
template <std::size_t count> bool sums_to_zero(const double (&terms)[count]) {
    double digits[count] = {};
    for (std::size_t i = 0; i < count; ++i) {
        double sum = terms[i];
        for (std::size_t j = 0; j < i; ++j) {
            const double whole = sum + digits[j], part = whole - sum;
            digits[j] = (sum - (whole - part)) + (digits[j] - part);
            sum = whole;
        }
        digits[i] = sum;
    }
    return std::all_of(std::begin(digits), std::end(digits), [](double digit) { return digit == 0; });
}

/// Decided exactly: products of two floats are doubles.
bool has_area(const Triangle &t) {
    const Vec3d a = to_double(t.a), b = to_double(t.b), c = to_double(t.c);
    if (largest_of(scaled_normal(t)) > 1e-14 * largest_of(b - a) * largest_of(c - a))
        return true; // far above the rounding errors of the normal
    for (std::size_t i = 0, j = 1; i < 3; j = (++i + 1) % 3)
        if (!sums_to_zero({a[i] * b[j], -a[j] * b[i], b[i] * c[j], -b[j] * c[i], c[i] * a[j], -c[j] * a[i]}))
            return true;
    return false;
}

bool is_usable(const Triangle &t) { return is_finite(t.a) && is_finite(t.b) && is_finite(t.c) && has_area(t); }

Vec3f vertex(const float *vertices, std::uint32_t index) {
    const float *v = vertices + std::size_t(3) * index;
    return {v[0], v[1], v[2]};
}

} // namespace

void TriangleSet::add(const float *vertices, std::size_t vertex_count, const std::uint32_t *faces,
                      std::size_t face_count) {
    if (triangles.size() + face_count > (std::size_t(1) << 31))
        throw std::length_error("more than 2^31 triangles in one tree");
    for (std::size_t i = 0; i < 3 * face_count; ++i)
        if (faces[i] >= vertex_count)
            throw std::out_of_range("triangle " + std::to_string(i / 3) + " refers to vertex " +
                                    std::to_string(faces[i]) + ", but the mesh has " + std::to_string(vertex_count) +
                                    " vertices");

    const StandardFloats floats;
    triangles.reserve(triangles.size() + face_count);
    for (std::size_t i = 0; i < face_count; ++i) {
        const std::uint32_t *f = faces + 3 * i;
        const Triangle t{vertex(vertices, f[0]), vertex(vertices, f[1]), vertex(vertices, f[2])};
        if (is_usable(t)) {
            valid.push_back(std::uint32_t(triangles.size()));
            for (const Vec3f &v : {t.a, t.b, t.c})
                bounds.extend(to_double(v));
        }
        triangles.push_back(t);
    }
}

void TriangleSet::add_primitive(const Bounds &box) {
    if (primitives.size() + 1 >= primitive_bit)
        throw std::length_error("2^31 primitives in one tree");
    const Bounds grown{{round_down(box.lower.x), round_down(box.lower.y), round_down(box.lower.z)},
                       {round_up(box.upper.x), round_up(box.upper.y), round_up(box.upper.z)}};
    primitives.push_back(grown);
    bounds.extend(grown.lower);
    bounds.extend(grown.upper);
}

void TriangleSet::rescale() {
    if (bounds.empty())
        return;
    const StandardFloats floats;
    scale = Scale::for_largest(std::max(largest_of(bounds.lower), largest_of(bounds.upper)));
    bounds = {};
    const auto scaled = [&](const Vec3f &v) { return Vec3f{scale.apply(v.x), scale.apply(v.y), scale.apply(v.z)}; };
    for (Triangle &t : triangles)
        t = {scaled(t.a), scaled(t.b), scaled(t.c)};
    for (const std::uint32_t id : valid)
        for (const Vec3f &v : {triangles[id].a, triangles[id].b, triangles[id].c})
            bounds.extend(to_double(v));
    for (Bounds &box : primitives) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            box.lower[axis] = scale.apply(box.lower[axis]);
            box.upper[axis] = scale.apply(box.upper[axis]);
        }
        bounds.extend(box.lower);
        bounds.extend(box.upper);
    }
}

Bounds TriangleSet::user_bounds() const {
    Bounds result = bounds;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        result.lower[axis] = scale.undo(bounds.lower[axis]);
        result.upper[axis] = scale.undo(bounds.upper[axis]);
    }
    return result;
}

} // namespace bsp
