/// The one traversal under all trees: a template over triangle test, query, node kinds, counting and `Mode`.
///
/// The ray's interval is cut at every plane, and the cut is widened by a bound on everything that rounding can do to
/// it, so that a leaf is visited whenever the triangle test finds one of its triangles hit. With u = 2^-24, R_k the
/// largest distance along axis k from the origin to the scene's box, and R the largest R_k:
/// - a hit that `WoopTest` reports lies within 8 u R, per axis, of a point of the triangle (shear: 6 u R; t: 2 u R);
///   in a tree with axes of its own (`Orientation`) within 32 u R, per axis of these: turning the error multiplies it
///   by sqrt(3), R there may be smaller by sqrt(3), and the turned vertices, origin and direction err by 1 u R each;
/// - along an axis, offset - o_k errs by u R_k, its product with 1/d_k by 3 u R_k;
/// - along an oblique normal n, n.o errs by 3 u |n||o|, n.d by 3 u |n||d| (times t: 3 u |n| R), the difference by u |n|
/// R and
///   its product with 1/(n.d) by 3 u |n| R.
/// Planes and references were compared in double precision when the tree was built; those errors are far below u. Where
/// references may protrude beyond oblique planes by a tolerance (trees of triangle planes), the tree says so, and every
/// such plane is widened by it: a point of a triangle is then still on its side of each plane above its leaf, for the
/// point was compared with each of them on its own, so that tolerances do not add up on the way down.
#pragma once

#include <algorithm>
#include <cmath>

#include "binary_layout.h"
#include "primitives.h"
#include "ray.h"
#include "settings.h"
#include "triangle_test.h"

namespace bsp {

/// How the traversal meets rounding errors, as `Precision` and `EarlyExit` say, or safely but for a mistake that is
/// planted to show that the tests would see it.
enum class Mode {
    safe,              ///< intervals are widened by a bound on all errors
    epsilon,           ///< by a fixed distance along the ray
    fast,              ///< not at all: no bound is computed, none is added
    exit_at_plane,     ///< only ends of intervals are widened, not where those behind a plane begin
    first_of_ties,     ///< equal t: the triangle found first stays
    far_child_dropped, ///< a hit before the plane, the bound forgotten, ends the search
    wrong_side,        ///< an origin in the plane visits one side only
    signed_zero,       ///< the sign of a zero direction component is ignored when children are ordered
    small_bound,       ///< a bound sixteen times too small
    small_moment,      ///< a bound sixteen times too small where triangles behind the origin are left out
    early_out,         ///< the first hit ends the search
    short_stack,       ///< the stack loses what does not fit
};

/// By what `Mode::epsilon` widens: a distance along the largest component of the ray's direction, where the scene's
/// largest coordinate is about 1 (`Scale`). So it means the same for every scene, as an epsilon in the user's units
/// would not.
constexpr float fixed_epsilon = 1e-5f;

/// Whether what is behind a plane begins where the plane was computed to be.
constexpr bool begins_at_plane(Mode mode) { return mode == Mode::exit_at_plane || mode == Mode::far_child_dropped; }

/// One half of the last digit, or what `Mode::small_bound` takes for it.
constexpr float error_unit(Mode mode) { return mode == Mode::small_bound ? 0x1p-28f : 0x1p-24f; }

/// Where an interval begins that is cut at `t`, and where one ends. `Mode::fast` does not even add 0.
template <Mode mode, typename T> T widened_begin(T t, T slack) {
    if constexpr (mode == Mode::fast)
        return t;
    else
        return t - slack;
}
template <Mode mode, typename T> T widened_end(T t, T slack) {
    if constexpr (mode == Mode::fast)
        return t;
    else
        return t + slack;
}

/// The closest hit within the ray's interval; equal t goes to the smaller id.
class ClosestQuery {
public:
    explicit ClosestQuery(float maxt) : m_hit(with_id(_mm_set_ss(maxt), no_triangle)) {}

    static constexpr bool is_any = false;
    float limit() const { return _mm_cvtss_f32(m_hit); }
    std::uint32_t known() const { return std::uint32_t(_mm_extract_epi32(_mm_castps_si128(m_hit), 3)); }

    /// True if the search is over. No branches but for equal t: whether a hit is closer can hardly be predicted.
    template <Mode mode> [[gnu::always_inline]] bool offer(const TriangleHit &hit, std::uint32_t id) {
        __m128 closer = _mm_and_ps(_mm_cmpge_ss(hit.tuv, _mm_setzero_ps()), _mm_cmplt_ss(hit.tuv, m_hit));
        if (__builtin_expect(hit.t() == limit(), false) && hit.t() >= 0 &&
            (mode == Mode::first_of_ties ? known() == no_triangle : id < known()))
            closer = _mm_castsi128_ps(_mm_set1_epi32(-1));
        m_hit = _mm_blendv_ps(m_hit, with_id(hit.tuv, id), _mm_permute_ps(closer, 0));
        return mode == Mode::early_out && known() != no_triangle;
    }

    Hit result() const {
        if (known() == no_triangle)
            return {};
        alignas(16) float tuv[4];
        _mm_store_ps(tuv, m_hit);
        return {tuv[0], tuv[1], tuv[2], known()};
    }

private:
    static __m128 with_id(__m128 tuv, std::uint32_t id) {
        return _mm_castsi128_ps(_mm_insert_epi32(_mm_castps_si128(tuv), int(id), 3));
    }

    __m128 m_hit; ///< a `Hit` in a register; without one t is the end of the ray's interval
};

/// Whether anything is hit within the ray's interval.
class AnyQuery {
public:
    explicit AnyQuery(float maxt) : m_maxt(maxt) {}

    static constexpr bool is_any = true;
    float limit() const { return m_maxt; }
    std::uint32_t known() const { return no_triangle; }

    template <Mode> bool offer(const TriangleHit &hit, std::uint32_t) {
        m_found |= (hit.t() >= 0) & (hit.t() <= m_maxt);
        return m_found;
    }

    bool result() const { return m_found; }

private:
    float m_maxt;
    bool m_found = false;
};

/// Counts nothing; the compiler removes it.
struct NoCounters {
    static constexpr bool counts = false;
};
struct CountInto {
    static constexpr bool counts = true;
    Counters &counters;
};

/// What the traversal needs to know of a ray, computed once. Rays are as `ScaledRay` has them.
template <Mode mode> struct RayFrame {
    Vec3f o, d, inverse;
    Vec3f axis_slack;        ///< widening of t at axis planes
    float oblique_slack = 0; ///< widening at oblique planes: times |n.d|, but of t for `Mode::epsilon`
    float smallest =
        0; ///< components of d and values n.d nearer to 0 count as this, which moves no point by more than 2^-40 R
    float entry, exit; ///< where the ray is inside the scene's box, widened

    RayFrame(const Ray &ray, const Box &box, float hit_error, float plane_tolerance) : o(ray.o), d(ray.d) {
        constexpr float unit = error_unit(mode);
        const float largest = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
        Vec3f reach;
        for (unsigned k = 0; k < 3; ++k)
            reach[k] = std::max(std::abs(box.lower[k] - o[k]), std::abs(box.upper[k] - o[k]));
        const float sum = reach.x + reach.y + reach.z, farthest = std::max({reach.x, reach.y, reach.z});
        smallest = largest * 0x1p-40f;
        oblique_slack =
            mode == Mode::epsilon
                ? fixed_epsilon / largest
                : unit * (3 * (std::abs(o.x) + std::abs(o.y) + std::abs(o.z)) + 7 * sum + 3 * hit_error * farthest) +
                      plane_tolerance;
        entry = 0;
        exit = ray.maxt;
        for (unsigned k = 0; k < 3; ++k) {
            inverse[k] = 1 / away_from_zero(d[k]);
            axis_slack[k] = mode == Mode::epsilon ? oblique_slack
                                                  : unit * (4 * reach[k] + hit_error * farthest) * std::abs(inverse[k]);
            const float t0 = (box.lower[k] - o[k]) * inverse[k], t1 = (box.upper[k] - o[k]) * inverse[k];
            entry = std::max(entry, widened_begin<mode>(std::min(t0, t1), axis_slack[k]));
            exit = std::min(exit, widened_end<mode>(std::max(t0, t1), axis_slack[k]));
        }
    }

    float away_from_zero(float x) const {
        if (std::abs(x) >= smallest)
            return x;
        return mode == Mode::signed_zero ? smallest : std::copysign(smallest, x);
    }
};

/// The largest size (without signs) of three numbers, in each lane.
template <Simd simd> struct LargestSize;
template <> struct LargestSize<Simd::avx2> {
    [[gnu::always_inline]] static Float8 of(const Float8 (&x)[3]) {
        const Float8 sign = Float8::all(-0.0f);
        return max(max(x[0].and_not(sign), x[1].and_not(sign)), x[2].and_not(sign));
    }
};
template <> struct LargestSize<Simd::avx512> {
    [[gnu::always_inline]] BSP_AVX512 static Float8 of(const Float8 (&x)[3]) {
        constexpr int largest = 0b1011; // of the sizes, without sign
        return {_mm256_range_ps(_mm256_range_ps(x[0].v, x[1].v, largest), x[2].v, largest)};
    }
};

/// The search through a leaf with one instruction set.
template <Simd simd> struct LeafSearch;

} // namespace bsp

#define BSP_EACH_SIMD "leaf_search.h"
#include "each_simd.h"

namespace bsp {

/// Where a ray meets the planes of one direction: t = (offset - start) * inverse, give or take `slack`.
struct Approach {
    float start, inverse, slack;
    bool downward; ///< the ray goes from above to below

    template <Mode mode> static Approach along_axis(const RayFrame<mode> &frame, unsigned k) {
        const bool downward = std::signbit(mode == Mode::signed_zero ? frame.d[k] : frame.inverse[k]);
        return {frame.o[k], frame.inverse[k], frame.axis_slack[k], downward};
    }

    template <Mode mode> static Approach along(const RayFrame<mode> &frame, unsigned k, float a, float b) {
        const unsigned i = next_axis[k], j = after_axis[k];
        const float speed = frame.away_from_zero(fmadd(b, frame.d[j], fmadd(a, frame.d[i], frame.d[k])));
        const float inverse = 1 / speed;
        return {fmadd(b, frame.o[j], fmadd(a, frame.o[i], frame.o[k])), inverse,
                mode == Mode::epsilon ? frame.oblique_slack : frame.oblique_slack * std::abs(inverse),
                std::signbit(speed)};
    }
};

/// What a ray knows of a layout's families of planes. Elsewhere there are none.
template <Splits splits> struct FamilyTable {
    template <Mode mode> FamilyTable(const RayFrame<mode> &, const BinaryLayout &) {}
    Approach operator[](unsigned) const { return {}; }
};
template <> struct FamilyTable<Splits::families> {
    template <Mode mode> FamilyTable(const RayFrame<mode> &frame, const BinaryLayout &layout) {
        Approach *approach = m_approaches;
        for (const Direction &direction : layout.families)
            *approach++ = Approach::along(frame, direction.major, direction.a, direction.b);
    }
    const Approach &operator[](unsigned family) const { return m_approaches[family]; }

private:
    Approach m_approaches[NodeWord::max_families];
};

template <Splits splits, Mode mode, typename Test, typename Query, typename Counting>
Query traverse(const BinaryLayout &layout, const ScaledRay &scaled, Query query, Counting counting) {
    if constexpr (Counting::counts)
        ++counting.counters.rays;
    const Ray ray = scaled.ray();
    const auto [o, d] = layout.orientation.seen(scaled.o, scaled.d);
    const RayFrame<mode> frame(ScaledRay{o, d, 1}.ray(), layout.box, layout.orientation.hit_error(),
                               layout.plane_tolerance);
    float entry = frame.entry, exit = frame.exit;
    if (!(entry <= exit))
        return query;
    const FamilyTable<splits> families(frame, layout);
    const auto test = make_test<Test>(ray, query);

    struct Pending {
        std::uint32_t word;
        float entry, exit;
    };
    constexpr int stack_size = mode == Mode::short_stack ? 4 : depth_limit + 2;
    Pending stack[stack_size];
    int pending = 0;

    const NodeWord *const words = layout.words.data();
    std::uint32_t at = 0;
    for (;;) {
        const NodeWord word = words[at];
        if (!word.is_leaf()) {
            const bool is_axis = splits == Splits::axes || word.is_axis();
            if constexpr (Counting::counts)
                ++(is_axis ? counting.counters.axis_steps : counting.counters.oblique_steps);
            Approach approach;
            std::uint32_t below = at + 1;
            if (is_axis) {
                approach = Approach::along_axis(frame, word.axis());
            } else if constexpr (splits == Splits::families) {
                approach = families[word.family_index()];
            } else {
                const NodeWord slopes = words[below++];
                approach = Approach::along(frame, word.axis(), slopes.a(), slopes.b());
            }
            const float t = (word.offset() - approach.start) * approach.inverse;
            const float begin = widened_begin<mode>(t, approach.slack), end = widened_end<mode>(t, approach.slack);
            const std::uint32_t first = approach.downward ? word.index() : below,
                                second = approach.downward ? below : word.index();
            if (end < entry || (mode == Mode::wrong_side && t <= entry)) {
                at = second;
            } else if (begin > exit) {
                at = first;
            } else {
                if (mode != Mode::short_stack || pending < stack_size)
                    stack[pending++] = {second, std::max(entry, begins_at_plane(mode) ? t : begin), exit};
                at = first;
                exit = std::min(exit, end);
            }
            continue;
        }
        if (const std::uint32_t count = word.triangle_count()) {
            const std::uint32_t blocks = (count + TriangleBlock::width - 1) / TriangleBlock::width;
            if (LeafSearch<Simd::avx2>::run<mode>(layout.blocks.data() + word.index(), blocks, entry, test, query,
                                                  counting))
                return query;
        }
        do {
            if (pending == 0)
                return query;
            --pending;
            at = stack[pending].word;
            entry = stack[pending].entry;
            exit = std::min(stack[pending].exit, query.limit());
        } while (mode == Mode::far_child_dropped ? entry >= query.limit() : entry > query.limit());
    }
}

} // namespace bsp
