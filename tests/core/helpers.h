/// Meshes and rays for the C++ tests.
#pragma once

#include <cmath>
#include <vector>

#include "accelerator.h"
#include "random.h"
#include "triangles.h"

namespace bsp {

/// Triangles given one by one, each with its own vertices.
inline TriangleSet make_set(const std::vector<Triangle> &triangles) {
    std::vector<float> vertices;
    std::vector<std::uint32_t> faces;
    for (const Triangle &t : triangles)
        for (const Vec3f &v : {t.a, t.b, t.c}) {
            faces.push_back(std::uint32_t(faces.size()));
            vertices.insert(vertices.end(), {v.x, v.y, v.z});
        }
    TriangleSet set;
    set.add(vertices.data(), vertices.size() / 3, faces.data(), triangles.size());
    return set;
}

/// Squares of a grid of boxes, turned by `angle` about two axes, in an order that tells the tree nothing.
inline std::vector<Triangle> squares_of_boxes(int side, float angle) {
    const float c = std::cos(angle), s = std::sin(angle);
    const auto turned = [&](Vec3f v) {
        v = {c * v.x - s * v.y, s * v.x + c * v.y, v.z};
        return Vec3f{v.x, c * v.y - s * v.z, s * v.y + c * v.z};
    };
    std::vector<Triangle> triangles;
    for (int x = 0; x < side; ++x)
        for (int y = 0; y < side; ++y)
            for (int axis = 0; axis < 3; ++axis)
                for (const float at : {0.1f, 0.9f}) {
                    const auto corner = [&](float u, float v) {
                        const float p[3] = {at, u, v};
                        return turned({float(x) + p[(3 - axis) % 3], float(y) + p[(4 - axis) % 3], p[(5 - axis) % 3]});
                    };
                    triangles.push_back({corner(0.1f, 0.1f), corner(0.9f, 0.1f), corner(0.1f, 0.9f)});
                    triangles.push_back({corner(0.9f, 0.9f), corner(0.9f, 0.1f), corner(0.1f, 0.9f)});
                }
    return triangles;
}
inline TriangleSet grid_of_boxes(int side, float angle) { return make_set(squares_of_boxes(side, angle)); }

inline Vec3f random_point(Random &random, float size = 1) {
    const auto coordinate = [&] { return float((2 * random.uniform() - 1) * size); };
    const float x = coordinate(), y = coordinate(), z = coordinate();
    return {x, y, z};
}

/// Small random triangles in the cube [-1, 1]^3.
inline TriangleSet random_soup(std::size_t count, std::uint64_t seed) {
    Random random(seed);
    std::vector<Triangle> triangles;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3f at = random_point(random);
        triangles.push_back(
            {at + random_point(random, 0.2f), at + random_point(random, 0.2f), at + random_point(random, 0.2f)});
    }
    return make_set(triangles);
}

/// Grids of boxes side by side, each turned its own way.
inline TriangleSet grids_askew(int side, int count = 6) {
    std::vector<Triangle> triangles;
    for (int i = 0; i < count; ++i) {
        const Vec3f by{float(3 * side * i), 0, 0};
        for (const Triangle &t : squares_of_boxes(side, 1.2f * float(i + 1) / float(count)))
            triangles.push_back({t.a + by, t.b + by, t.c + by});
    }
    return make_set(triangles);
}

/// From around the cube, half of them at vertices of the set.
inline std::vector<Ray> aimed_rays(const TriangleSet &set, std::size_t count, std::uint64_t seed) {
    Random random(seed);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3f o = random_point(random, 2);
        const Triangle &t = set.triangles[random.below(std::uint32_t(set.triangles.size()))];
        rays.push_back({o, (random.uniform() < 0.5 ? t.a : random_point(random)) - o});
    }
    return rays;
}

inline bool same_bits(const Hit &x, const Hit &y) {
    return x.t == y.t && x.u == y.u && x.v == y.v && x.triangle == y.triangle;
}

} // namespace bsp
