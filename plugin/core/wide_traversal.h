/// The traversal of wide nodes. One pass computes where the ray meets all seven planes of a node; then the eight lanes
/// become its eight cells in the order in which the ray passes them, near to far, and each cuts the ray's interval by
/// the three planes on its path. Cells do not overlap, so the order is right and the first hit in it ends most
/// searches.
#pragma once

#include <array>

#include "traversal.h"
#include "wide_layout.h"

namespace bsp {

/// Where things are in a node whose planes the ray passes downward or not: bit i of `signs` is set if it passes plane i
/// from above to below, so that the child above is the near one.
struct WideOrder {
    static constexpr unsigned sign_count = 1u << WideNode::planes;

    /// The plane of the second and of the third level that each cell, by rank, is parted by; for the signs of planes 0,
    /// 1 and 2, which decide it.
    alignas(32) std::int32_t second[8][8], third[8][8];
    /// The cell of each rank, for the signs of all planes.
    std::uint8_t cells[sign_count][8];

    constexpr WideOrder() : second{}, third{}, cells{} {
        for (unsigned signs = 0; signs < sign_count; ++signs)
            for (unsigned rank = 0; rank < 8; ++rank) {
                unsigned plane = 0, cell = 0, path[3] = {};
                for (unsigned level = 0; level < 3; ++level) {
                    path[level] = plane;
                    const unsigned far = rank >> (2 - level) & 1, above = far ^ (signs >> plane & 1) ^ 0u;
                    cell = 2 * cell + above;
                    plane = 2 * plane + 1 + above;
                }
                cells[signs][rank] = std::uint8_t(cell);
                second[signs & 7][rank] = std::int32_t(path[1]);
                third[signs & 7][rank] = std::int32_t(path[2]);
            }
    }
};
inline constexpr WideOrder wide_order{};

/// A ray's numbers in all lanes.
template <Fault fault> struct WideRay {
    Vec3<Float8> o, d;
    Float8 smallest, slack;

    explicit WideRay(const RayFrame<fault> &frame)
        : o{Float8::all(frame.o.x), Float8::all(frame.o.y), Float8::all(frame.o.z)},
          d{Float8::all(frame.d.x), Float8::all(frame.d.y), Float8::all(frame.d.z)},
          smallest(Float8::all(frame.smallest)), slack(Float8::all(frame.oblique_slack)) {}
};

/// The cells of a node that a ray passes, by rank from near to far: a bit each, and the interval in each.
struct WideCut {
    alignas(32) float entry[8], exit[8];
    unsigned ranks;
    const std::uint8_t *cells;

    template <Fault fault> WideCut(const WideNode &node, const WideRay<fault> &ray, float from, float to) {
        const __m256 sign = _mm256_set1_ps(-0.0f);
        const Float8 x = Float8::load(node.normals[0]), y = Float8::load(node.normals[1]),
                     z = Float8::load(node.normals[2]);
        const Float8 start = fmadd(z, ray.o.z, fmadd(y, ray.o.y, x * ray.o.x));
        Float8 speed = fmadd(z, ray.d.z, fmadd(y, ray.d.y, x * ray.d.x));
        const __m256 signs = fault == Fault::signed_zero ? _mm256_setzero_ps() : _mm256_and_ps(speed.v, sign);
        const Float8 size{_mm256_andnot_ps(sign, speed.v)};
        const Float8 held{_mm256_or_ps(signs, ray.smallest.v)};
        speed.v = _mm256_blendv_ps(speed.v, held.v, (size < ray.smallest).v);
        const Float8 inverse = Float8::all(1) / speed;
        const Float8 t = (Float8::load(node.offsets) - start) * inverse;
        const Float8 slack = ray.slack * Float8{_mm256_andnot_ps(sign, inverse.v)};
        const Float8 low = fault == Fault::far_child_dropped || fault == Fault::wrong_side ? t : t - slack,
                     high = fault == Fault::wrong_side ? t : t + slack;

        const unsigned downward = speed.bits() & (WideOrder::sign_count - 1);
        cells = wide_order.cells[downward];
        Float8 begin = Float8::all(from), end = Float8::all(to);
        cut<0xf0>(_mm256_setzero_si256(), low, high, begin, end);
        cut<0xcc>(_mm256_load_si256(reinterpret_cast<const __m256i *>(wide_order.second[downward & 7])), low, high,
                  begin, end);
        cut<0xaa>(_mm256_load_si256(reinterpret_cast<const __m256i *>(wide_order.third[downward & 7])), low, high,
                  begin, end);
        _mm256_store_ps(entry, begin.v);
        _mm256_store_ps(exit, end.v);
        ranks = (begin <= end).bits();
    }

private:
    /// One level: ranks in `far` begin where the ray meets their plane, the others end there. The operands are in the
    /// order in which min and max drop what is not a number.
    template <int far> static void cut(__m256i planes, Float8 low, Float8 high, Float8 &begin, Float8 &end) {
        const __m256 infinity = _mm256_set1_ps(HUGE_VALF), minus_infinity = _mm256_set1_ps(-HUGE_VALF);
        const Float8 begins{_mm256_blend_ps(minus_infinity, _mm256_permutevar8x32_ps(low.v, planes), far)};
        const Float8 ends{_mm256_blend_ps(_mm256_permutevar8x32_ps(high.v, planes), infinity, far)};
        begin = max(begins, begin);
        end = min(ends, end);
    }
};

template <Fault fault, typename Test, typename Query, typename Counting>
void traverse(const WideLayout &layout, const Ray &ray, Query &query, Counting counting) {
    if constexpr (Counting::counts)
        ++counting.counters.rays;
    const RayFrame<fault> frame(ray, layout.box, layout.plane_tolerance);
    float entry = frame.entry, exit = frame.exit;
    if (!(entry <= exit))
        return;
    const Test test(ray);
    const WideRay<fault> wide(frame);

    struct Pending {
        WideChild child;
        float entry, exit;
    };
    // At most seven wait at each of the levels, and large leaves add some.
    constexpr int stack_size = fault == Fault::short_stack ? 8 : 7 * (depth_limit / 3 + 16);
    Pending stack[stack_size];
    int pending = 0;

    const WideNode *node = layout.nodes.data();
    for (;;) {
        if constexpr (Counting::counts)
            ++(layout.has_oblique ? counting.counters.oblique_steps : counting.counters.axis_steps);
        const WideCut cut(*node, wide, entry, exit);
        unsigned ranks = cut.ranks;
        while (ranks != 0) { // the farthest first, so that the nearest is on top
            const unsigned rank = 31 - unsigned(__builtin_clz(ranks));
            ranks ^= 1u << rank;
            const WideChild child = node->children[cut.cells[rank]];
            stack[pending] = {child, cut.entry[rank], cut.exit[rank]};
            pending += !child.is_empty() && (fault != Fault::short_stack || pending + 1 < stack_size);
        }
        for (;;) {
            if (pending == 0)
                return;
            const Pending &next = stack[--pending];
            if (next.entry > query.limit())
                continue;
            if (!next.child.is_leaf()) {
                node = layout.nodes.data() + next.child.node_index();
                entry = next.entry;
                exit = std::min(next.exit, query.limit());
                break;
            }
            const TriangleBlock *const blocks = layout.blocks.data() + next.child.first_block();
            if (visit_blocks<fault>(blocks, next.child.block_count(), test, query, counting))
                return;
        }
    }
}

} // namespace bsp
