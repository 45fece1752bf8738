/// The one traversal under all trees: a template over triangle test, query, node kinds, counting and planted faults.
///
/// The ray's interval is cut at every plane, and the cut is widened by a bound on everything that rounding can do to
/// it, so that a leaf is visited whenever the triangle test finds one of its triangles hit. With u = 2^-24, R_k the
/// largest distance along axis k from the origin to the scene's box, and R the largest R_k:
/// - a hit that `WoopTest` reports lies within 8 u R, per axis, of a point of the triangle (shear: 6 u R; t: 2 u R);
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
#include "ray.h"
#include "settings.h"
#include "triangle_test.h"

namespace bsp {

/// Mistakes that can be planted in the traversal, to show that the tests would see them.
enum class Fault {
    none,
    first_of_ties,     ///< equal t: the triangle found first stays
    far_child_dropped, ///< a hit before the plane, the bound forgotten, ends the search
    wrong_side,        ///< an origin in the plane visits one side only
    signed_zero,       ///< the sign of a zero direction component is ignored when children are ordered
    small_bound,       ///< a bound sixteen times too small
    no_bound,          ///< no bound at all
    early_out,         ///< the first hit ends the search
    short_stack,       ///< the stack loses what does not fit
};

/// The closest hit within the ray's interval; equal t goes to the smaller id.
class ClosestQuery {
public:
    explicit ClosestQuery(float maxt) { m_hit.t = maxt; }

    static constexpr bool is_any = false;
    float limit() const { return m_hit.t; }
    std::uint32_t known() const { return m_hit.triangle; } ///< it need not be tested again

    template <Fault fault> bool offer(const TriangleHit &hit, std::uint32_t id) {
        const bool tie = fault == Fault::first_of_ties ? !m_hit.found() : id < m_hit.triangle;
        if (hit.t >= 0 && (hit.t < m_hit.t || (hit.t == m_hit.t && tie)))
            m_hit = {hit.t, hit.u, hit.v, id};
        return fault == Fault::early_out && m_hit.found();
    }

    Hit result() const { return m_hit.found() ? m_hit : Hit{}; }

private:
    Hit m_hit;
};

/// Whether anything is hit within the ray's interval.
class AnyQuery {
public:
    explicit AnyQuery(float maxt) : m_maxt(maxt) {}

    static constexpr bool is_any = true;
    float limit() const { return m_maxt; }
    std::uint32_t known() const { return no_triangle; }

    template <Fault> bool offer(const TriangleHit &hit, std::uint32_t) {
        m_found |= hit.t >= 0 && hit.t <= m_maxt;
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

/// What the traversal needs to know of a ray, computed once.
template <Fault fault> struct RayFrame {
    Vec3f o, d, inverse;
    Vec3f axis_slack;        ///< widening of t at axis planes
    float oblique_slack = 0; ///< widening at oblique planes, times |n.d|
    float smallest =
        0; ///< components of d and values n.d nearer to 0 count as this, which moves no point by more than 2^-40 R
    float entry = 0, exit = -1; ///< where the ray is inside the scene's box, widened

    RayFrame(const Ray &ray, const Box &box, float plane_tolerance) : o(ray.o), d(ray.d) {
        constexpr float unit = (fault == Fault::no_bound ? 0.f : fault == Fault::small_bound ? 0x1p-28f : 0x1p-24f);
        const float largest = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
        Vec3f reach;
        for (unsigned k = 0; k < 3; ++k)
            reach[k] = std::max(std::abs(box.lower[k] - o[k]), std::abs(box.upper[k] - o[k]));
        const float sum = reach.x + reach.y + reach.z, farthest = std::max({reach.x, reach.y, reach.z});
        // Not a number or infinite somewhere, or no direction: `exit` stays below `entry`, a miss.
        if (!(sum < HUGE_VALF && largest > 0 && largest < HUGE_VALF))
            return;
        smallest = largest * 0x1p-40f;
        oblique_slack =
            unit * (3 * (std::abs(o.x) + std::abs(o.y) + std::abs(o.z)) + 7 * sum + 24 * farthest) + plane_tolerance;
        entry = 0;
        exit = ray.maxt;
        for (unsigned k = 0; k < 3; ++k) {
            inverse[k] = 1 / away_from_zero(d[k]);
            axis_slack[k] = unit * (4 * reach[k] + 8 * farthest) * std::abs(inverse[k]);
            const float t0 = (box.lower[k] - o[k]) * inverse[k], t1 = (box.upper[k] - o[k]) * inverse[k];
            entry = std::max(entry, std::min(t0, t1) - axis_slack[k]);
            exit = std::min(exit, std::max(t0, t1) + axis_slack[k]);
        }
    }

    float away_from_zero(float x) const {
        if (std::abs(x) >= smallest)
            return x;
        return fault == Fault::signed_zero ? smallest : std::copysign(smallest, x);
    }
};

/// Offers the triangles of blocks to the query; true if the search is over.
template <Fault fault, typename Test, typename Query, typename Counting>
bool visit_blocks(const TriangleBlock *block, std::uint32_t count, const Test &test, Query &query, Counting counting) {
    if constexpr (Counting::counts) {
        ++counting.counters.leaves;
        for (std::uint32_t i = 0; i < count; ++i)
            counting.counters.triangle_tests += block[i].triangle_count();
    }
    for (; count > 0; --count, ++block)
        for (unsigned lanes = test.candidates(*block, query.limit(), query.known()); lanes != 0; lanes &= lanes - 1) {
            const unsigned lane = unsigned(__builtin_ctz(lanes));
            if (const auto hit = test.intersect(TriangleBlock::Lane{*block, lane}))
                if (query.template offer<fault>(*hit, block->ids[lane]))
                    return true;
        }
    return false;
}

/// Where a ray meets the planes of one direction: t = (offset - start) * inverse, give or take `slack`.
struct Approach {
    float start, inverse, slack;
    bool downward; ///< the ray goes from above to below

    template <Fault fault> static Approach along_axis(const RayFrame<fault> &frame, unsigned k) {
        const bool downward = std::signbit(fault == Fault::signed_zero ? frame.d[k] : frame.inverse[k]);
        return {frame.o[k], frame.inverse[k], frame.axis_slack[k], downward};
    }

    template <Fault fault> static Approach along(const RayFrame<fault> &frame, unsigned k, float a, float b) {
        const unsigned i = next_axis[k], j = after_axis[k];
        const float speed = frame.away_from_zero(fmadd(b, frame.d[j], fmadd(a, frame.d[i], frame.d[k])));
        const float inverse = 1 / speed;
        return {fmadd(b, frame.o[j], fmadd(a, frame.o[i], frame.o[k])), inverse,
                frame.oblique_slack * std::abs(inverse), std::signbit(speed)};
    }
};

/// What a ray knows of a layout's families of planes. Elsewhere there are none.
template <Splits splits> struct FamilyTable {
    template <Fault fault> FamilyTable(const RayFrame<fault> &, const BinaryLayout &) {}
    Approach operator[](unsigned) const { return {}; }
};
template <> struct FamilyTable<Splits::families> {
    template <Fault fault> FamilyTable(const RayFrame<fault> &frame, const BinaryLayout &layout) {
        Approach *approach = m_approaches;
        for (const Direction &direction : layout.families)
            *approach++ = Approach::along(frame, direction.major, direction.a, direction.b);
    }
    const Approach &operator[](unsigned family) const { return m_approaches[family]; }

private:
    Approach m_approaches[NodeWord::max_families];
};

template <Splits splits, Fault fault, typename Test, typename Query, typename Counting>
void traverse(const BinaryLayout &layout, const Ray &ray, Query &query, Counting counting) {
    if constexpr (Counting::counts)
        ++counting.counters.rays;
    const RayFrame<fault> frame(ray, layout.box, layout.plane_tolerance);
    float entry = frame.entry, exit = frame.exit;
    if (!(entry <= exit))
        return;
    const FamilyTable<splits> families(frame, layout);
    const Test test(ray);

    struct Pending {
        std::uint32_t word;
        float entry, exit;
    };
    constexpr int stack_size = fault == Fault::short_stack ? 4 : depth_limit + 2;
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
            const float t = (word.offset() - approach.start) * approach.inverse, slack = approach.slack;
            const std::uint32_t first = approach.downward ? word.index() : below,
                                second = approach.downward ? below : word.index();
            if (t + slack < entry || (fault == Fault::wrong_side && t <= entry)) {
                at = second;
            } else if (t - slack > exit) {
                at = first;
            } else {
                if (fault != Fault::short_stack || pending < stack_size)
                    stack[pending++] = {second, std::max(entry, fault == Fault::far_child_dropped ? t : t - slack),
                                        exit};
                at = first;
                exit = std::min(exit, t + slack);
            }
            continue;
        }
        if (const std::uint32_t count = word.triangle_count()) {
            const std::uint32_t blocks = (count + TriangleBlock::width - 1) / TriangleBlock::width;
            if (visit_blocks<fault>(layout.blocks.data() + word.index(), blocks, test, query, counting))
                return;
        }
        do {
            if (pending == 0)
                return;
            --pending;
            at = stack[pending].word;
            entry = stack[pending].entry;
            exit = std::min(stack[pending].exit, query.limit());
        } while (fault == Fault::far_child_dropped ? entry >= query.limit() : entry > query.limit());
    }
}

} // namespace bsp
