/// What is no triangle: bounded primitives that their owner intersects. A tree lists each in every leaf whose cell its
/// box meets; there it is tested over the whole ray, whatever the cell. Trees without any do not know of them.
///
/// Nothing is asked of the owner's arithmetic. A primitive counts as hit if its owner says so and the ray meets its
/// box, and a hit before or behind the box is moved to where the ray enters or leaves it: so hits lie where the tree
/// lists the primitive, and every tree and the loop over all find the same, even where the owner reports nonsense.
/// (Mitsuba's routine for ellipsoids does, for small ones: t may be wrong by many of their radii.)
///
/// Rounding, as traversal.h counts it, with R the largest distance along an axis from the origin to a corner of the
/// box: the box is widened by 4 u R; a t that is computed from it errs by 3 u, relative, which is 3 u R along an axis.
/// So a hit lies within 8 u R, per axis, of the box, as that of a triangle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "ray.h"
#include "scale.h"
#include "triangle_block.h"
#include "triangle_test.h"

namespace bsp {

/// The owner. Asked from many threads at once.
class Primitives {
public:
    virtual ~Primitives() = default;

    /// t of the first hit within the ray's interval, in the user's units; infinite if there is none.
    virtual float closest(std::uint32_t index, const Ray &ray) const noexcept = 0;
};

/// Asks the owner about one ray.
class PrimitiveQuestion {
public:
    /// `ray` in the user's units, and the same in the accelerator's.
    PrimitiveQuestion(const Primitives &owner, const Ray &ray, const ScaledRay &own)
        : m_owner(owner), m_ray(ray), m_o{own.o[0], own.o[1], own.o[2]},
          m_inverse{1 / own.d[0], 1 / own.d[1], 1 / own.d[2]}, m_per_t(own.per_t) {}

    /// In the accelerator's units, not a number if the primitive is missed. `box`: corner 0 and the opposite one.
    template <typename Corners> float t(const Corners &box, std::uint32_t index) const {
        float reach = 0;
        for (unsigned axis = 0; axis < 3; ++axis)
            reach = std::max({reach, std::abs(box(0, axis) - m_o[axis]), std::abs(box(1, axis) - m_o[axis])});
        const float margin = 0x1p-22f * reach;
        float begin = 0, end = std::numeric_limits<float>::infinity();
        for (unsigned axis = 0; axis < 3; ++axis) {
            const float a = (box(0, axis) - margin - m_o[axis]) * m_inverse[axis],
                        b = (box(1, axis) + margin - m_o[axis]) * m_inverse[axis];
            begin = std::fmax(begin, std::fmin(a, b)); // what is not a number does not narrow the interval
            end = std::fmin(end, std::fmax(a, b));
        }
        if (!(begin <= end))
            return NAN;
        const double found = double(m_owner.closest(index, m_ray)) / m_per_t;
        return std::isfinite(found) ? std::clamp(float(found), begin, end) : NAN;
    }

private:
    const Primitives &m_owner;
    const Ray &m_ray;
    Vec3f m_o, m_inverse;
    double m_per_t;
};

/// A query that can ask.
template <typename Query> struct WithPrimitives : Query {
    WithPrimitives(float maxt, const PrimitiveQuestion &own) : Query(maxt), question(own) {}

    PrimitiveQuestion question;
};

/// A triangle test that asks the owner where a block lists a primitive. Who was asked last is remembered, for a
/// primitive is in many leaves.
template <typename Test> class MixedTest {
public:
    MixedTest(const Ray &ray, const PrimitiveQuestion &question) : m_test(ray), m_question(question) {
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
        if (asked == id)
            return {_mm_set1_ps(NAN)};
        asked = id;
        return {_mm_setr_ps(m_question.t(lane, primitive_index(id)), 0, 0, 0)};
    }

private:
    static constexpr std::uint32_t remembered = 16;

    Test m_test;
    PrimitiveQuestion m_question;
    mutable std::uint32_t m_asked[remembered]; ///< by their lowest bits
};

template <typename Query> struct AsksPrimitives : std::false_type {};
template <typename Query> struct AsksPrimitives<WithPrimitives<Query>> : std::true_type {};

/// The test of a ray in the accelerator's units, which also tests primitives if the query asks about them.
template <typename Test, typename Query>
[[gnu::always_inline]] inline auto make_test(const Ray &ray, const Query &query) {
    if constexpr (AsksPrimitives<Query>::value)
        return MixedTest<Test>(ray, query.question);
    else
        return Test(ray);
}

} // namespace bsp
