#include "triangles.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace bsp {

void Bounds::extend(const Vec3d &p) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        lower[axis] = std::min(lower[axis], p[axis]);
        upper[axis] = std::max(upper[axis], p[axis]);
    }
}

Vec3d scaled_normal(const Triangle &t) {
    const Vec3d a = to_double(t.a);
    return cross(to_double(t.b) - a, to_double(t.c) - a);
}

namespace {

bool is_finite(const Vec3f &v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

bool is_usable(const Triangle &t) {
    return is_finite(t.a) && is_finite(t.b) && is_finite(t.c) && !(scaled_normal(t) == Vec3d{});
}

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

} // namespace bsp
