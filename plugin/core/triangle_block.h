/// The leaf format of every tree: blocks of eight triangles, their vertices copied next to one another.
#pragma once

#include <cstdint>

#include "ray.h"
#include "simd.h"
#include "triangles.h"

namespace bsp {

struct alignas(32) TriangleBlock {
    static constexpr unsigned width = Float8::width;

    float vertices[3][3][width]; ///< [vertex][axis][lane]; unused lanes hold anything finite
    std::uint32_t ids[width];    ///< `no_triangle` in unused lanes

    void set(unsigned lane, const Triangle &t, std::uint32_t id) {
        const Vec3f corners[3] = {t.a, t.b, t.c};
        for (unsigned vertex = 0; vertex < 3; ++vertex)
            for (unsigned axis = 0; axis < 3; ++axis)
                vertices[vertex][axis][lane] = corners[vertex][axis];
        ids[lane] = id;
    }

    /// Negative in each lane with this id; `no_triangle`: in those that are not in use.
    Float8 lanes_of(std::uint32_t id) const {
        const __m256i all = _mm256_load_si256(reinterpret_cast<const __m256i *>(ids));
        return {_mm256_castsi256_ps(_mm256_cmpeq_epi32(all, _mm256_set1_epi32(int(id))))};
    }
    unsigned triangle_count() const { return width - unsigned(__builtin_popcount(lanes_of(no_triangle).bits())); }

    Float8 load(unsigned vertex, unsigned axis) const { return Float8::load(vertices[vertex][axis]); }

    /// One of its triangles, by coordinates.
    struct Lane {
        const TriangleBlock &block;
        unsigned lane;
        float operator()(unsigned corner, unsigned axis) const { return block.vertices[corner][axis][lane]; }
    };
};

} // namespace bsp
