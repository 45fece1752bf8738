/// What is no triangle: bounded primitives that their owner intersects. A tree lists each in every leaf whose cell its
/// box meets; there it is tested over the whole ray, whatever the cell. Trees without any do not know of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "ray.h"
#include "triangle_block.h"
#include "triangle_test.h"

namespace bsp {

/// The owner. Asked from many threads at once.
class Primitives {
public:
    virtual ~Primitives() = default;

    /// t of the first hit within the ray's interval, in the user's units; infinite if there is none.
    virtual float closest(std::uint32_t index, const Ray &ray) const noexcept = 0;
    virtual bool any(std::uint32_t index, const Ray &ray) const noexcept = 0;
};

/// Asks the owner about one ray: `ray` in the user's units, of which one of the accelerator's t is `per_t`.
struct PrimitiveQuestion {
    const Primitives &owner;
    const Ray &ray;
    double per_t;

    /// In the accelerator's units. Any-hit rays are told 0 for a hit.
    template <bool is_any> float t(std::uint32_t index) const {
        if constexpr (is_any)
            return owner.any(index, ray) ? 0 : std::numeric_limits<float>::infinity();
        else
            return float(double(owner.closest(index, ray)) / per_t);
    }
};

/// A query that can ask.
template <typename Query> struct WithPrimitives : Query {
    WithPrimitives(float maxt, const PrimitiveQuestion &own) : Query(maxt), question(own) {}

    PrimitiveQuestion question;
};

/// A triangle test that asks the owner where a block lists a primitive whose box the ray meets. Who was asked last is
/// remembered, for a primitive is in many leaves.
template <typename Test, bool is_any> class MixedTest {
public:
    MixedTest(const Ray &ray, const PrimitiveQuestion &question)
        : m_test(ray), m_question(question), m_o(ray.o), m_inverse{1 / ray.d.x, 1 / ray.d.y, 1 / ray.d.z} {
        std::fill_n(m_asked, remembered, no_triangle);
    }

    unsigned candidates(const TriangleBlock &block) const {
        const __m256i ids = _mm256_load_si256(reinterpret_cast<const __m256i *>(block.ids));
        const __m256i unused = _mm256_cmpeq_epi32(ids, _mm256_set1_epi32(int(no_triangle)));
        const __m256i primitives = _mm256_andnot_si256(unused, ids); // their sign bit is set
        return m_test.candidates(block) | unsigned(_mm256_movemask_ps(_mm256_castsi256_ps(primitives)));
    }

    TriangleHit intersect(const TriangleBlock::Lane &lane) const {
        const std::uint32_t id = lane.block.ids[lane.lane];
        if (!is_primitive(id))
            return m_test.intersect(lane);
        std::uint32_t &asked = m_asked[id % remembered];
        if (asked == id || !meets_box(lane))
            return {_mm_set1_ps(NAN)};
        asked = id;
        return {_mm_setr_ps(m_question.t<is_any>(primitive_index(id)), 0, 0, 0)};
    }

private:
    static constexpr std::uint32_t remembered = 16;

    /// Boxes have margins far above the rounding errors of this test. What is not a number does not narrow the
    /// interval.
    bool meets_box(const TriangleBlock::Lane &lane) const {
        float begin = 0, end = std::numeric_limits<float>::infinity();
        for (unsigned axis = 0; axis < 3; ++axis) {
            const float a = (lane(0, axis) - m_o[axis]) * m_inverse[axis],
                        b = (lane(1, axis) - m_o[axis]) * m_inverse[axis];
            begin = std::fmax(begin, std::fmin(a, b));
            end = std::fmin(end, std::fmax(a, b));
        }
        return begin <= end;
    }

    Test m_test;
    PrimitiveQuestion m_question;
    Vec3f m_o, m_inverse;
    mutable std::uint32_t m_asked[remembered]; ///< by their lowest bits
};

template <typename Query> struct AsksPrimitives : std::false_type {};
template <typename Query> struct AsksPrimitives<WithPrimitives<Query>> : std::true_type {};

/// The test of a ray in the accelerator's units, which also tests primitives if the query asks about them.
template <typename Test, typename Query>
[[gnu::always_inline]] inline auto make_test(const Ray &ray, const Query &query) {
    if constexpr (AsksPrimitives<Query>::value)
        return MixedTest<Test, Query::is_any>(ray, query.question);
    else
        return Test(ray);
}

} // namespace bsp
