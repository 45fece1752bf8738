/// Rays, hits and counters: the vocabulary of queries.
#pragma once

#include <cstdint>
#include <limits>

#include "vec.h"

namespace bsp {

/// The points o + t d with 0 <= t <= maxt. The direction need not be normalised.
struct Ray {
    Vec3f o, d;
    float maxt = std::numeric_limits<float>::infinity();
};

constexpr std::uint32_t no_triangle = 0xffffffffu;

/// What is no triangle has ids of its own, behind those of all triangles.
constexpr std::uint32_t primitive_bit = 0x80000000u;
constexpr std::uint32_t primitive_id(std::uint32_t index) { return index | primitive_bit; }
constexpr std::uint32_t primitive_index(std::uint32_t id) { return id & ~primitive_bit; }
constexpr bool is_primitive(std::uint32_t id) { return (id & primitive_bit) != 0 && id != no_triangle; }

/// p = (1 - u - v) a + u b + v c on triangle (a, b, c).
struct Hit {
    float t = std::numeric_limits<float>::infinity();
    float u = 0, v = 0;
    std::uint32_t triangle = no_triangle;

    bool found() const { return triangle != no_triangle; }
};

/// What rays cost. A triangle test is one triangle; unused lanes of a block are not counted.
struct Counters {
    std::uint64_t rays = 0, axis_steps = 0, oblique_steps = 0, leaves = 0, triangle_tests = 0;

    Counters &operator+=(const Counters &o) {
        rays += o.rays;
        axis_steps += o.axis_steps;
        oblique_steps += o.oblique_steps;
        leaves += o.leaves;
        triangle_tests += o.triangle_tests;
        return *this;
    }
    Counters operator-(const Counters &o) const {
        return {rays - o.rays, axis_steps - o.axis_steps, oblique_steps - o.oblique_steps, leaves - o.leaves,
                triangle_tests - o.triangle_tests};
    }
};

/// Some of the bytes that an accelerator reads while it answers.
struct MemoryPart {
    const void *data;
    std::size_t size;
};

} // namespace bsp
