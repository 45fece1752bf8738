/// The traversal of wide nodes. One pass computes where the ray meets all seven planes of a node; then the eight lanes
/// become its eight cells in the order in which the ray passes them, near to far, and each cuts the ray's interval by
/// the three planes on its path. Cells do not overlap, so the order is right and the first hit in it ends most
/// searches.
#pragma once

#include "traversal.h"
#include "wide_layout.h"

namespace bsp {

/// Where things are in a node whose planes the ray passes downward or not: bit i of `signs` is set if it passes plane i
/// from above to below, so that the child above is the near one. Lane 7 is the nearest cell, lane 0 the farthest.
struct WideOrder {
    static constexpr unsigned sign_count = 1u << WideNode::planes;

    /// The plane of the second and of the third level that the cell of each lane is parted by; for the signs of planes
    /// 0, 1 and 2, which decide it.
    alignas(32) std::int32_t second[8][8], third[8][8];
    /// The cell of each lane, for the signs of all planes.
    std::uint8_t cells[sign_count][8];

    constexpr WideOrder() : second{}, third{}, cells{} {
        for (unsigned signs = 0; signs < sign_count; ++signs)
            for (unsigned lane = 0; lane < 8; ++lane) {
                unsigned plane = 0, cell = 0, path[3] = {};
                for (unsigned level = 0; level < 3; ++level) {
                    path[level] = plane;
                    const unsigned near = lane >> (2 - level) & 1, above = near ^ 1 ^ (signs >> plane & 1);
                    cell = 2 * cell + above;
                    plane = 2 * plane + 1 + above;
                }
                cells[signs][lane] = std::uint8_t(cell);
                second[signs & 7][lane] = std::int32_t(path[1]);
                third[signs & 7][lane] = std::int32_t(path[2]);
            }
    }
};
inline constexpr WideOrder wide_order{};

/// For every set of lanes, where they come from when they are moved together, in their order.
struct LaneCompaction {
    std::uint8_t sources[256][8];

    constexpr LaneCompaction() : sources{} {
        for (unsigned set = 0; set < 256; ++set)
            for (unsigned lane = 0, to = 0; lane < 8; ++lane)
                if (set >> lane & 1)
                    sources[set][to++] = std::uint8_t(lane);
    }
};
inline constexpr LaneCompaction lane_compaction{};

inline __m256i load_lanes(const std::uint8_t *lanes) {
    return _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i *>(lanes)));
}

/// What the traversal of wide nodes needs to know of a ray. Lanes 0, 1 and 2 belong to the axes, or to planes whose
/// major axis they are. The bounds are those derived in traversal.h, with these differences: an axis-aligned plane's
/// offset is multiplied by 1/d_k before the origin is subtracted, which adds 3 u |o_k / d_k|; at oblique planes the
/// bound is added to the distance, before the division, which adds u R; and sums over the axes are replaced by three
/// times the largest term, which is no less.
template <Fault fault> struct WideRay {
    Float8 inverse, low, high;  ///< an axis plane is met between offset * inverse + low and offset * inverse + high
    Float8 d[3], o[3];          ///< component 0 is that along the major axis, 1 and 2 those along the next two
    Float8 slack;               ///< at oblique planes
    float entry = 0, exit = -1; ///< where the ray is inside the scene's box, widened

    [[gnu::always_inline]] WideRay(const Ray &ray, const WideBox &box, float plane_tolerance) {
        constexpr float unit = fault == Fault::no_bound ? 0.f : fault == Fault::small_bound ? 0x1p-28f : 0x1p-24f;
        const __m128 origin = _mm_setr_ps(ray.o.x, ray.o.y, ray.o.z, 0),
                     direction = _mm_setr_ps(ray.d.x, ray.d.y, ray.d.z, 0);
        const __m128 sign = _mm_set1_ps(-0.0f), infinity = _mm_set1_ps(HUGE_VALF);
        const __m128 size = _mm_andnot_ps(sign, direction), largest = largest_of(size);
        const __m128 lower = _mm_sub_ps(_mm_load_ps(box.lower), origin),
                     upper = _mm_sub_ps(_mm_load_ps(box.upper), origin);
        const __m128 reach = _mm_max_ps(_mm_andnot_ps(sign, lower), _mm_andnot_ps(sign, upper));
        const __m128 finite = _mm_and_ps(_mm_cmplt_ps(reach, infinity), _mm_cmplt_ps(size, infinity));
        // Not a number or infinite somewhere, or no direction: `exit` stays below `entry`, a miss.
        if (_mm_movemask_ps(finite) != 15 || !(_mm_cvtss_f32(largest) > 0))
            return;
        const __m128 far_origin = _mm_andnot_ps(sign, origin);
        const __m128 bound = largest_of(
            _mm_add_ps(_mm_mul_ps(_mm_set1_ps(9 * unit), far_origin), _mm_mul_ps(_mm_set1_ps(93 * unit), reach)));
        slack = Float8{_mm256_set_m128(bound, bound)} + Float8::all(plane_tolerance);

        // Components nearer to 0 than this count as this, which moves no point by more than 2^-40 of the reach.
        const __m128 smallest = _mm_mul_ps(largest, _mm_set1_ps(0x1p-40f));
        const __m128 kept_sign = fault == Fault::signed_zero ? _mm_setzero_ps() : _mm_and_ps(direction, sign);
        const __m128 speed = _mm_blendv_ps(direction, _mm_or_ps(smallest, kept_sign), _mm_cmplt_ps(size, smallest));
        const __m128 per_speed = _mm_div_ps(_mm_set1_ps(1), speed), per_size = _mm_andnot_ps(sign, per_speed);
        const __m128 axis_slack =
            _mm_mul_ps(_mm_add_ps(_mm_mul_ps(_mm_set1_ps(3 * unit), far_origin),
                                  _mm_add_ps(_mm_mul_ps(_mm_set1_ps(4 * unit), reach),
                                             _mm_mul_ps(_mm_set1_ps(8 * unit), largest_of(reach)))),
                       per_size);
        const __m128 t0 = _mm_mul_ps(lower, per_speed), t1 = _mm_mul_ps(upper, per_speed);
        const __m128 begin = _mm_sub_ps(_mm_min_ps(t0, t1), axis_slack),
                     end = _mm_add_ps(_mm_max_ps(t0, t1), axis_slack);
        entry = std::max(0.f, _mm_cvtss_f32(largest_of(begin)));
        exit = std::min(ray.maxt, -_mm_cvtss_f32(largest_of(_mm_xor_ps(end, sign))));

        const __m128 start = _mm_xor_ps(_mm_mul_ps(origin, per_speed), sign), zero = _mm_setzero_ps();
        inverse = lanes(per_speed);
        low = lanes(
            _mm_sub_ps(start, fault == Fault::far_child_dropped || fault == Fault::wrong_side ? zero : axis_slack));
        high = lanes(_mm_add_ps(start, fault == Fault::wrong_side ? zero : axis_slack));
        d[0] = lanes(direction);
        d[1] = lanes(_mm_permute_ps(direction, 0b11001001));
        d[2] = lanes(_mm_permute_ps(direction, 0b11010010));
        o[0] = lanes(origin);
        o[1] = lanes(_mm_permute_ps(origin, 0b11001001));
        o[2] = lanes(_mm_permute_ps(origin, 0b11010010));
    }

private:
    static Float8 lanes(__m128 x) { return {_mm256_castps128_ps256(x)}; }
    /// Of the first three lanes, in all four.
    static __m128 largest_of(__m128 x) {
        return _mm_max_ps(_mm_max_ps(_mm_permute_ps(x, 0), _mm_permute_ps(x, 0b01010101)),
                          _mm_permute_ps(x, 0b10101010));
    }
};

/// Where a ray meets the seven planes of a node, widened, and which planes it passes downward.
struct WideMeet {
    Float8 low, high;
    unsigned downward;

    /// All planes lie along the axes.
    template <Fault fault>
    [[gnu::always_inline]] static WideMeet axes(const WideNode &node, const WideRay<fault> &ray) {
        const __m256i axis = major_axes(node);
        const Float8 inverse = ray.inverse[axis], offsets = Float8::load(node.offsets);
        return {fmadd(offsets, inverse, ray.low[axis]), fmadd(offsets, inverse, ray.high[axis]),
                (fault == Fault::signed_zero ? ray.d[0][axis] : inverse).bits()};
    }

    template <Fault fault>
    [[gnu::always_inline]] static WideMeet any(const WideNode &node, const WideSlopes &slopes,
                                               const WideRay<fault> &ray) {
        const __m256i axis = major_axes(node);
        const Float8 a = Float8::load(slopes.a), b = Float8::load(slopes.b);
        const Float8 speed = fmadd(b, ray.d[2][axis], fmadd(a, ray.d[1][axis], ray.d[0][axis]));
        const Float8 inverse = Float8::all(1) / speed;
        const Float8 distance =
            Float8::load(node.offsets) - fmadd(b, ray.o[2][axis], fmadd(a, ray.o[1][axis], ray.o[0][axis]));
        const Float8 slack{_mm256_xor_ps(ray.slack.v, _mm256_and_ps(speed.v, _mm256_set1_ps(-0.0f)))};
        // Where the ray runs along a plane the inverse is infinite, and so are these, or not a number.
        const bool no_low = fault == Fault::far_child_dropped || fault == Fault::wrong_side;
        return {(no_low ? distance : distance - slack) * inverse,
                (fault == Fault::wrong_side ? distance : distance + slack) * inverse, speed.bits()};
    }

private:
    static __m256i major_axes(const WideNode &node) {
        return _mm256_srli_epi32(_mm256_load_si256(reinterpret_cast<const __m256i *>(node.children)),
                                 WideChild::axis_shift);
    }
};

/// The cells of a node that a ray passes, a lane each, near to far from lane 7 on, and its interval in each.
struct WideCut {
    Float8 begin, end;
    __m256i children;
    unsigned lanes;

    [[gnu::always_inline]] WideCut(const WideNode &node, const WideMeet &meet, float from, float to) {
        const unsigned downward = meet.downward & (WideOrder::sign_count - 1);
        children = _mm256_permutevar8x32_epi32(_mm256_load_si256(reinterpret_cast<const __m256i *>(node.children)),
                                               load_lanes(wide_order.cells[downward]));
        const __m256i first = _mm256_setzero_si256(), second = load(wide_order.second[downward & 7]),
                      third = load(wide_order.third[downward & 7]);
        begin = max(begins<0x0f>(first, meet.low), Float8::all(from));
        end = min(ends<0x0f>(first, meet.high), Float8::all(to));
        begin = max(begins<0x55>(third, meet.low), max(begins<0x33>(second, meet.low), begin));
        end = min(ends<0x55>(third, meet.high), min(ends<0x33>(second, meet.high), end));
        const __m256i empty = _mm256_cmpeq_epi32(_mm256_slli_epi32(children, 32 - WideChild::axis_shift), first);
        lanes = unsigned(_mm256_movemask_ps(_mm256_andnot_ps(_mm256_castsi256_ps(empty), (begin <= end).v)));
    }

private:
    static __m256i load(const std::int32_t *lanes) {
        return _mm256_load_si256(reinterpret_cast<const __m256i *>(lanes));
    }

    /// One level: lanes in `far` begin where the ray meets their plane, the others end there. What is not a number is
    /// dropped by max and min, being their first operand.
    template <int far> static Float8 begins(__m256i planes, Float8 low) {
        return {_mm256_blend_ps(_mm256_set1_ps(-HUGE_VALF), low[planes].v, far)};
    }
    template <int far> static Float8 ends(__m256i planes, Float8 high) {
        return {_mm256_blend_ps(high[planes].v, _mm256_set1_ps(HUGE_VALF), far)};
    }
};

/// A cell that waits, and the ray's interval in it.
struct WideCell {
    WideChild child;
    float begin, end;
};

/// Cells that wait, the nearest on top.
template <int size> class WideStack {
public:
    bool empty() const { return m_count == 0; }

    /// Takes the cells of `cut` but the nearest, which it returns; there must be one.
    [[gnu::always_inline]] WideCell push(const WideCut &cut) {
        alignas(32) std::uint32_t children[8];
        alignas(32) float begins[8], ends[8];
        _mm256_store_si256(reinterpret_cast<__m256i *>(children), cut.children);
        _mm256_store_ps(begins, cut.begin.v);
        _mm256_store_ps(ends, cut.end.v);
        const unsigned nearest = 31 - unsigned(__builtin_clz(cut.lanes));
        const unsigned others = cut.lanes ^ 1u << nearest;
        if (m_count + 7 <= size) {
            const __m256i from = load_lanes(lane_compaction.sources[others]);
            _mm256_storeu_si256(reinterpret_cast<__m256i *>(m_children + m_count),
                                _mm256_permutevar8x32_epi32(cut.children, from));
            _mm256_storeu_ps(m_begins + m_count, cut.begin[from].v);
            _mm256_storeu_ps(m_ends + m_count, cut.end[from].v);
            m_count += __builtin_popcount(others);
        }
        return {WideChild::in(children[nearest]), begins[nearest], ends[nearest]};
    }

    [[gnu::always_inline]] WideCell pop() {
        --m_count;
        return {WideChild::in(m_children[m_count]), m_begins[m_count], m_ends[m_count]};
    }

private:
    std::uint32_t m_children[size + 1]; ///< eight are written at a time
    float m_begins[size + 1], m_ends[size + 1];
    int m_count = 0;
};

template <Fault fault, typename Test, typename Query, typename Counting>
void traverse(const WideLayout &layout, const Ray &ray, Query &query, Counting counting) {
    if constexpr (Counting::counts)
        ++counting.counters.rays;
    const WideRay<fault> wide(ray, layout.box, layout.plane_tolerance);
    if (!(wide.entry <= wide.exit))
        return;
    const Test test(ray);

    // At most seven wait at each of the levels, and large leaves add some.
    WideStack<fault == Fault::short_stack ? 8 : 7 * (depth_limit / 3 + 16)> stack;
    WideCell cell{layout.root, wide.entry, wide.exit};
    for (;;) {
        if (!cell.child.is_leaf()) {
            const WideLine *const line = layout.lines.data() + cell.child.index();
            const bool is_oblique = cell.child.is_oblique();
            if constexpr (Counting::counts)
                ++(is_oblique ? counting.counters.oblique_steps : counting.counters.axis_steps);
            const WideMeet meet =
                is_oblique ? WideMeet::any(line->node, line[1].slopes, wide) : WideMeet::axes(line->node, wide);
            const WideCut cut(line->node, meet, cell.begin, cell.end);
            if (cut.lanes != 0) {
                cell = stack.push(cut);
                continue;
            }
        } else if (visit_blocks<fault>(layout.blocks.data() + cell.child.index(), cell.child.block_count(), test, query,
                                       counting)) {
            return;
        }
        do {
            if (stack.empty())
                return;
            cell = stack.pop();
        } while (!Query::is_any && cell.begin > query.limit());
        if (!Query::is_any)
            cell.end = std::min(cell.end, query.limit());
    }
}

} // namespace bsp
