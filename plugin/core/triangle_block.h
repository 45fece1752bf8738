/// The leaf format of every tree: blocks of eight triangles, their vertices copied next to one another.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "ray.h"
#include "simd.h"
#include "triangles.h"

namespace bsp {

/// The box of a primitive as rays see it, in floats, which `TriangleSet::add_primitive` has seen to.
struct PrimitiveBox {
    Vec3f corners[2]; ///< the lower and the upper one

    explicit PrimitiveBox(const Bounds &box)
        : corners{{float(box.lower.x), float(box.lower.y), float(box.lower.z)},
                  {float(box.upper.x), float(box.upper.y), float(box.upper.z)}} {}

    float operator()(unsigned corner, unsigned axis) const { return corners[corner][axis]; }
};

struct alignas(32) TriangleBlock {
    static constexpr unsigned width = Float8::width;

    float vertices[3][3][width]; ///< [vertex][axis][lane]; not numbers in unused lanes, so that no test accepts them
    std::uint32_t ids[width];    ///< `no_triangle` in unused lanes

    TriangleBlock() {
        for (auto &corner : vertices)
            for (auto &axis : corner)
                std::fill_n(axis, width, std::numeric_limits<float>::quiet_NaN());
        std::fill_n(ids, width, no_triangle);
    }

    void set(unsigned lane, const Triangle &t, std::uint32_t id) {
        for (unsigned corner = 0; corner < 3; ++corner)
            for (unsigned axis = 0; axis < 3; ++axis)
                vertices[corner][axis][lane] = t(corner, axis);
        ids[lane] = id;
    }

    /// Of a primitive the block holds two corners of its box; the third is not a number, so that no triangle test hits.
    void set(unsigned lane, const PrimitiveBox &box, std::uint32_t id) {
        for (unsigned corner = 0; corner < 2; ++corner)
            for (unsigned axis = 0; axis < 3; ++axis)
                vertices[corner][axis][lane] = box(corner, axis);
        ids[lane] = id;
    }

    unsigned triangle_count() const { return width - unsigned(std::count(ids, ids + width, no_triangle)); }

    Float8 load(std::size_t vertex, std::size_t axis) const { return Float8::load(vertices[vertex][axis]); }

    /// The first vertices' coordinates along an axis; those of the second are `vertex_size` floats behind. Three
    /// pointers are all that a loop over blocks needs.
    const float *axis(std::size_t axis) const { return &vertices[0][0][0] + axis * width; }
    static constexpr std::size_t vertex_size = 3 * width;

    /// One of its triangles, by coordinates.
    struct Lane {
        const TriangleBlock &block;
        unsigned lane;
        float operator()(unsigned corner, unsigned axis) const { return block.vertices[corner][axis][lane]; }
    };
};

} // namespace bsp
