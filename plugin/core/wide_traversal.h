/// The traversal of wide nodes. One pass computes where the ray meets all seven planes of a node; then every cell cuts
/// the ray's interval by the three planes on its path, and unless any hit will do, the eight lanes are put in the order
/// in which the ray passes their cells. The search is in wide_search.h. Cells do not overlap, so the order is right and
/// the first hit in it ends most searches.
#pragma once

#include "traversal.h"
#include "wide_layout.h"

namespace bsp {

/// The cells of a node in the order in which a ray passes them: bit i of `signs` is set if it passes the plane of lane
/// i from above to below, so that the child above is the near one. Entry 7 is the nearest cell, entry 0 the farthest.
struct WideOrder {
    static constexpr unsigned sign_count = 1u << WideNode::cells;

    std::uint8_t cells[sign_count][8];

    constexpr WideOrder() : cells{} {
        for (unsigned signs = 0; signs < sign_count; ++signs)
            for (unsigned entry = 0; entry < 8; ++entry) {
                unsigned plane = 0, cell = 0;
                for (unsigned level = 0; level < 3; ++level) {
                    const unsigned near = entry >> (2 - level) & 1;
                    const unsigned above = near ^ 1 ^ (signs >> WideNode::lane_of_plane[plane] & 1);
                    cell = 2 * cell + above;
                    plane = 2 * plane + 1 + above;
                }
                cells[signs][entry] = std::uint8_t(cell);
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

/// What the traversal of wide nodes needs to know of a ray. Lanes 0, 1 and 2 of each half belong to the axes, or to
/// planes whose major axis they are. The bounds are those derived in traversal.h, with these differences: an
/// axis-aligned plane's offset is multiplied by 1/d_k before the origin is subtracted, which adds 3 u |o_k / d_k|; at
/// oblique planes the bound is added to the distance, before the division, which adds u R; and sums over the axes are
/// replaced by three times the largest term, which is no less.
template <Mode mode> struct WideRay {
    Float8 inverse, low, high; ///< an axis plane is met between offset * inverse + low and offset * inverse + high
    Float8 d[3], o[3];         ///< component 0 is that along the major axis, 1 and 2 those along the next two
    Float8 slack;              ///< at oblique planes; of t for `Mode::epsilon`
    float entry, exit;         ///< where the ray is inside the scene's box, widened

    [[gnu::always_inline]] WideRay(__m128 origin, __m128 direction, const WideBox &box, float hit_error,
                                   float plane_tolerance) {
        constexpr float unit = error_unit(mode);
        const __m128 sign = _mm_set1_ps(-0.0f);
        const __m128 size = _mm_andnot_ps(sign, direction), largest = largest_of(size);
        const __m128 lower = _mm_sub_ps(_mm_load_ps(box.lower), origin),
                     upper = _mm_sub_ps(_mm_load_ps(box.upper), origin);
        const __m128 reach = _mm_max_ps(_mm_andnot_ps(sign, lower), _mm_andnot_ps(sign, upper));
        const __m128 far_origin = _mm_andnot_ps(sign, origin);
        const __m128 bound = largest_of(_mm_add_ps(_mm_mul_ps(_mm_set1_ps(9 * unit), far_origin),
                                                   _mm_mul_ps(_mm_set1_ps((69 + 3 * hit_error) * unit), reach)));
        const __m128 epsilon = _mm_div_ps(_mm_set1_ps(fixed_epsilon), largest);
        slack = mode == Mode::epsilon ? twice(epsilon) : twice(bound) + Float8::all(plane_tolerance);

        // Components nearer to 0 than this count as this, which moves no point by more than 2^-40 of the reach.
        const __m128 smallest = _mm_mul_ps(largest, _mm_set1_ps(0x1p-40f));
        const __m128 kept_sign = mode == Mode::signed_zero ? _mm_setzero_ps() : _mm_and_ps(direction, sign);
        const __m128 speed = _mm_blendv_ps(direction, _mm_or_ps(smallest, kept_sign), _mm_cmplt_ps(size, smallest));
        const __m128 per_speed = _mm_div_ps(_mm_set1_ps(1), speed), per_size = _mm_andnot_ps(sign, per_speed);
        const __m128 axis_slack =
            mode == Mode::epsilon
                ? epsilon
                : _mm_mul_ps(_mm_add_ps(_mm_mul_ps(_mm_set1_ps(3 * unit), far_origin),
                                        _mm_add_ps(_mm_mul_ps(_mm_set1_ps(4 * unit), reach),
                                                   _mm_mul_ps(_mm_set1_ps(hit_error * unit), largest_of(reach)))),
                             per_size);
        const __m128 t0 = _mm_mul_ps(lower, per_speed), t1 = _mm_mul_ps(upper, per_speed);
        const __m128 begin = widened_begin<mode>(_mm_min_ps(t0, t1), axis_slack),
                     end = widened_end<mode>(_mm_max_ps(t0, t1), axis_slack);
        entry = std::max(0.f, _mm_cvtss_f32(largest_of(begin)));
        exit = std::min(direction[3], -_mm_cvtss_f32(largest_of(_mm_xor_ps(end, sign))));

        const __m128 start = _mm_xor_ps(_mm_mul_ps(origin, per_speed), sign), zero = _mm_setzero_ps();
        inverse = twice(per_speed);
        low = twice(widened_begin<mode>(start, begins_at_plane(mode) || mode == Mode::wrong_side ? zero : axis_slack));
        high = twice(widened_end<mode>(start, mode == Mode::wrong_side ? zero : axis_slack));
        d[0] = twice(direction);
        d[1] = twice(_mm_permute_ps(direction, 0b11001001));
        d[2] = twice(_mm_permute_ps(direction, 0b11010010));
        o[0] = twice(origin);
        o[1] = twice(_mm_permute_ps(origin, 0b11001001));
        o[2] = twice(_mm_permute_ps(origin, 0b11010010));
    }

private:
    static Float8 twice(__m128 x) { return {_mm256_set_m128(x, x)}; }
    /// Of the first three lanes, in all four.
    static __m128 largest_of(__m128 x) {
        return _mm_max_ps(_mm_max_ps(_mm_permute_ps(x, 0), _mm_permute_ps(x, 0b01010101)),
                          _mm_permute_ps(x, 0b10101010));
    }
};

inline __m256i load_children(const WideNode &node) {
    return _mm256_load_si256(reinterpret_cast<const __m256i *>(node.children));
}

/// Of three numbers in each half, that of the major axis of the lane's plane.
inline Float8 of_axis(Float8 x, __m256i children) { return {_mm256_permutevar_ps(x.v, children)}; }

/// Where a ray meets the planes of a node, a lane each, widened; it passes those downward whose `signs` is negative.
struct WideMeet {
    Float8 low, high, signs;

    template <Mode mode>
    [[gnu::always_inline]] static WideMeet planes(const WideLine *line, bool is_oblique, const WideRay<mode> &ray) {
        return is_oblique ? any(line->node, line[1].slopes, ray) : axes(line->node, ray);
    }

private:
    /// All planes lie along the axes.
    template <Mode mode> [[gnu::always_inline]] static WideMeet axes(const WideNode &node, const WideRay<mode> &ray) {
        const __m256i axis = load_children(node);
        const Float8 inverse = of_axis(ray.inverse, axis), offsets = Float8::load(node.offsets);
        const Float8 low = fmadd(offsets, inverse, of_axis(ray.low, axis));
        return {low, mode == Mode::fast ? low : fmadd(offsets, inverse, of_axis(ray.high, axis)),
                mode == Mode::signed_zero ? of_axis(ray.d[0], axis) : inverse};
    }

    template <Mode mode>
    [[gnu::always_inline]] static WideMeet any(const WideNode &node, const WideSlopes &slopes,
                                               const WideRay<mode> &ray) {
        const __m256i axis = load_children(node);
        const Float8 a = Float8::load(slopes.a), b = Float8::load(slopes.b);
        const auto along = [&](const Float8(&x)[3]) {
            return fmadd(b, of_axis(x[2], axis), fmadd(a, of_axis(x[1], axis), of_axis(x[0], axis)));
        };
        const Float8 speed = along(ray.d), inverse = Float8::all(1) / speed;
        const Float8 distance = Float8::load(node.offsets) - along(ray.o);
        // Where the ray runs along a plane the inverse is infinite, and so are these, or not a number.
        if constexpr (mode == Mode::fast || mode == Mode::epsilon) {
            const Float8 t = distance * inverse;
            return {widened_begin<mode>(t, ray.slack), widened_end<mode>(t, ray.slack), speed};
        }
        const Float8 slack{_mm256_xor_ps(ray.slack.v, _mm256_and_ps(speed.v, _mm256_set1_ps(-0.0f)))};
        const bool no_low = begins_at_plane(mode) || mode == Mode::wrong_side;
        return {(no_low ? distance : distance - slack) * inverse,
                (mode == Mode::wrong_side ? distance : distance + slack) * inverse, speed};
    }
};

/// The ray's interval in each of the eight cells, a lane each. On the near side of a plane it ends where the ray meets
/// the plane, on the far side it begins there: what holds below and above each plane goes to the cells on either side.
/// What is not a number is dropped by max and min, being their first operand.
struct WideIntervals {
    Float8 begin, end;

    [[gnu::always_inline]] WideIntervals(Float8 begin_below, Float8 begin_above, Float8 end_below, Float8 end_above,
                                         float from, float to)
        : begin(max(max(second(begin_below, begin_above), third(begin_below, begin_above)),
                    max(first(begin_below, begin_above), Float8::all(from)))),
          end(min(min(second(end_below, end_above), third(end_below, end_above)),
                  min(first(end_below, end_above), Float8::all(to)))) {}

private:
    // Of each level, from the lanes of `WideNode::plane_of_lane`.
    static Float8 first(Float8 below, Float8 above) {
        return {_mm256_permute_ps(_mm256_blend_ps(below.v, above.v, 0xf0), 0)};
    }
    static Float8 second(Float8 below, Float8 above) { return {_mm256_shuffle_ps(below.v, above.v, 0b01010101)}; }
    static Float8 third(Float8 below, Float8 above) { return {_mm256_unpackhi_ps(below.v, above.v)}; }
};

/// The cells of a node that a ray passes, and its interval in each; near to far from lane 7 on, or in no order.
struct WideCut {
    Float8 begin, end;
    __m256i children;
    unsigned lanes;
    bool first_is_downward; ///< the ray passes the first plane from above to below
};

/// The lanes in the order in which the ray passes their cells, near to far from lane 7 on, if they are to be `ordered`.
struct WideLanesInOrder {
    Float8 begin, end;
    __m256i children;

    template <bool ordered>
    [[gnu::always_inline]] static WideLanesInOrder of(const WideIntervals &cells, const WideNode &node,
                                                      unsigned signs) {
        const __m256i children = load_children(node);
        if constexpr (!ordered)
            return {cells.begin, cells.end, children};
        const __m256i order = load_lanes(wide_order.cells[signs]);
        return {cells.begin[order], cells.end[order], _mm256_permutevar8x32_epi32(children, order)};
    }
};

/// What instruction sets do in their own way: choosing by sign, and moving lanes together. The bits are the same.
template <Simd simd> struct WideLanes;

/// The traversal with one instruction set.
template <Simd simd> struct WideSearch;

template <> struct WideLanes<Simd::avx2> {
    template <bool ordered>
    [[gnu::always_inline]] static WideCut cut(const WideNode &node, const WideMeet &meet, float from, float to) {
        const Float8 always = Float8::all(HUGE_VALF), never = Float8::all(-HUGE_VALF);
        const auto choose = [&](Float8 upward, Float8 downward) {
            return Float8{_mm256_blendv_ps(upward.v, downward.v, meet.signs.v)};
        };
        const WideIntervals cells(choose(never, meet.low), choose(meet.low, never), choose(meet.high, always),
                                  choose(always, meet.high), from, to);
        const unsigned signs = meet.signs.bits();
        const auto [begin, end, children] = WideLanesInOrder::of<ordered>(cells, node, signs);
        const __m256i own = _mm256_andnot_si256(_mm256_set1_epi32(WideChild::axis_bits), children);
        const __m256i empty = _mm256_cmpeq_epi32(own, _mm256_setzero_si256());
        const unsigned lanes =
            unsigned(_mm256_movemask_ps(_mm256_andnot_ps(_mm256_castsi256_ps(empty), (begin <= end).v)));
        return {begin, end, children, lanes, (signs & 1) != 0};
    }

    /// The lanes of `set` moved together, in their order; anything behind them.
    [[gnu::always_inline]] static Float8 together(Float8 x, unsigned set) {
        return x[load_lanes(lane_compaction.sources[set])];
    }
};

template <> struct WideLanes<Simd::avx512> {
    template <bool ordered>
    [[gnu::always_inline]] BSP_AVX512 static WideCut cut(const WideNode &node, const WideMeet &meet, float from,
                                                         float to) {
        const __m256 always = _mm256_set1_ps(HUGE_VALF), never = _mm256_set1_ps(-HUGE_VALF);
        const __m256 low = meet.low.v, high = meet.high.v;
        const __mmask8 down = _mm256_movepi32_mask(_mm256_castps_si256(meet.signs.v));
        const WideIntervals cells({_mm256_mask_mov_ps(never, down, low)}, {_mm256_mask_mov_ps(low, down, never)},
                                  {_mm256_mask_mov_ps(high, down, always)}, {_mm256_mask_mov_ps(always, down, high)},
                                  from, to);
        const auto [begin, end, children] = WideLanesInOrder::of<ordered>(cells, node, down);
        const __mmask8 full = _mm256_test_epi32_mask(children, _mm256_set1_epi32(~int(WideChild::axis_bits)));
        return {begin, end, children, _mm256_mask_cmp_ps_mask(full, begin.v, end.v, _CMP_LE_OQ), (down & 1) != 0};
    }

    [[gnu::always_inline]] BSP_AVX512 static Float8 together(Float8 x, unsigned set) {
        return {_mm256_maskz_compress_ps(__mmask8(set), x.v)};
    }
};

/// A cell that waits, and the ray's interval in it.
struct WideCell {
    WideChild child;
    float begin, end;
};

/// Cells that wait; of one node, the nearest on top. Its height is apart from its memory, to stay in a register.
class WideStack {
public:
    /// A ray that goes on with one cell at a time leaves at most seven at each level; large leaves add some levels.
    /// The rest of the memory is for passing two nodes at a time.
    static constexpr unsigned reserve = 7 * (depth_limit / 3 + 16), size = reserve + 64;

    struct Memory {
        std::uint32_t children[size + WideNode::cells]; ///< eight are written at a time
        float begins[size + WideNode::cells], ends[size + WideNode::cells];
    };

    /// Below all cells is a leaf that is none.
    explicit WideStack(Memory &memory) : m(memory) {
        m.children[0] = WideChild::leaf(0, 0).with_axis(0);
        m.begins[0] = m.ends[0] = 0;
    }

    bool empty() const { return m_height == 1; }
    bool has_room_for(unsigned more) const { return m_height + more <= size; }

    [[gnu::always_inline]] WideCell top() const {
        const unsigned at = m_height - 1;
        return {WideChild(m.children[at]), m.begins[at], m.ends[at]};
    }
    void drop() { --m_height; }

    /// Takes the first `count` lanes.
    [[gnu::always_inline]] void push(Float8 children, Float8 begins, Float8 ends, unsigned count) {
        _mm256_storeu_ps(reinterpret_cast<float *>(m.children + m_height), children.v);
        _mm256_storeu_ps(m.begins + m_height, begins.v);
        _mm256_storeu_ps(m.ends + m_height, ends.v);
        m_height += count;
    }

private:
    Memory &m;
    unsigned m_height = 1;
};

} // namespace bsp

#define BSP_EACH_SIMD "wide_search.h"
#include "each_simd.h"
