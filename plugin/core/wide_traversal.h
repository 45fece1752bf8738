/// The traversal of wide nodes. One pass computes where the ray meets all seven planes of a node; then the eight lanes
/// become its eight cells in the order in which the ray passes them, near to far, and each cuts the ray's interval by
/// the three planes on its path. The search is in wide_search.h. Cells do not overlap, so the order is right and the
/// first hit in it ends most searches.
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
template <Mode mode> struct WideRay {
    Float8 inverse, low, high; ///< an axis plane is met between offset * inverse + low and offset * inverse + high
    Float8 d[3], o[3];         ///< component 0 is that along the major axis, 1 and 2 those along the next two
    Float8 slack;              ///< at oblique planes; of t for `Mode::epsilon`
    float entry, exit;         ///< where the ray is inside the scene's box, widened

    [[gnu::always_inline]] WideRay(const Ray &ray, const WideBox &box, float plane_tolerance) {
        constexpr float unit = error_unit(mode);
        const __m128 origin = _mm_setr_ps(ray.o.x, ray.o.y, ray.o.z, 0),
                     direction = _mm_setr_ps(ray.d.x, ray.d.y, ray.d.z, 0);
        const __m128 sign = _mm_set1_ps(-0.0f);
        const __m128 size = _mm_andnot_ps(sign, direction), largest = largest_of(size);
        const __m128 lower = _mm_sub_ps(_mm_load_ps(box.lower), origin),
                     upper = _mm_sub_ps(_mm_load_ps(box.upper), origin);
        const __m128 reach = _mm_max_ps(_mm_andnot_ps(sign, lower), _mm_andnot_ps(sign, upper));
        const __m128 far_origin = _mm_andnot_ps(sign, origin);
        const __m128 bound = largest_of(
            _mm_add_ps(_mm_mul_ps(_mm_set1_ps(9 * unit), far_origin), _mm_mul_ps(_mm_set1_ps(93 * unit), reach)));
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
                                                   _mm_mul_ps(_mm_set1_ps(8 * unit), largest_of(reach)))),
                             per_size);
        const __m128 t0 = _mm_mul_ps(lower, per_speed), t1 = _mm_mul_ps(upper, per_speed);
        const __m128 begin = widened_begin<mode>(_mm_min_ps(t0, t1), axis_slack),
                     end = widened_end<mode>(_mm_max_ps(t0, t1), axis_slack);
        entry = std::max(0.f, _mm_cvtss_f32(largest_of(begin)));
        exit = std::min(ray.maxt, -_mm_cvtss_f32(largest_of(_mm_xor_ps(end, sign))));

        const __m128 start = _mm_xor_ps(_mm_mul_ps(origin, per_speed), sign), zero = _mm_setzero_ps();
        inverse = lanes(per_speed);
        low = lanes(widened_begin<mode>(
            start, mode == Mode::far_child_dropped || mode == Mode::wrong_side ? zero : axis_slack));
        high = lanes(widened_end<mode>(start, mode == Mode::wrong_side ? zero : axis_slack));
        d[0] = lanes(direction);
        d[1] = lanes(_mm_permute_ps(direction, 0b11001001));
        d[2] = lanes(_mm_permute_ps(direction, 0b11010010));
        o[0] = lanes(origin);
        o[1] = lanes(_mm_permute_ps(origin, 0b11001001));
        o[2] = lanes(_mm_permute_ps(origin, 0b11010010));
    }

private:
    static Float8 lanes(__m128 x) { return {_mm256_castps128_ps256(x)}; }
    static Float8 twice(__m128 x) { return {_mm256_set_m128(x, x)}; }
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
    template <Mode mode> [[gnu::always_inline]] static WideMeet axes(const WideNode &node, const WideRay<mode> &ray) {
        const __m256i axis = major_axes(node);
        const Float8 inverse = ray.inverse[axis], offsets = Float8::load(node.offsets);
        const unsigned downward = (mode == Mode::signed_zero ? ray.d[0][axis] : inverse).bits();
        const Float8 low = fmadd(offsets, inverse, ray.low[axis]);
        return {low, mode == Mode::fast ? low : fmadd(offsets, inverse, ray.high[axis]), downward};
    }

    template <Mode mode>
    [[gnu::always_inline]] static WideMeet any(const WideNode &node, const WideSlopes &slopes,
                                               const WideRay<mode> &ray) {
        const __m256i axis = major_axes(node);
        const Float8 a = Float8::load(slopes.a), b = Float8::load(slopes.b);
        const Float8 speed = fmadd(b, ray.d[2][axis], fmadd(a, ray.d[1][axis], ray.d[0][axis]));
        const Float8 inverse = Float8::all(1) / speed;
        const Float8 distance =
            Float8::load(node.offsets) - fmadd(b, ray.o[2][axis], fmadd(a, ray.o[1][axis], ray.o[0][axis]));
        // Where the ray runs along a plane the inverse is infinite, and so are these, or not a number.
        if constexpr (mode == Mode::fast || mode == Mode::epsilon) {
            const Float8 t = distance * inverse;
            return {widened_begin<mode>(t, ray.slack), widened_end<mode>(t, ray.slack), speed.bits()};
        }
        const Float8 slack{_mm256_xor_ps(ray.slack.v, _mm256_and_ps(speed.v, _mm256_set1_ps(-0.0f)))};
        const bool no_low = mode == Mode::far_child_dropped || mode == Mode::wrong_side;
        return {(no_low ? distance : distance - slack) * inverse,
                (mode == Mode::wrong_side ? distance : distance + slack) * inverse, speed.bits()};
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
};

/// What instruction sets do in their own way: cutting the interval, and moving lanes together. The bits are the same.
template <Simd simd> struct WideLanes;

/// The traversal with one instruction set.
template <Simd simd> struct WideSearch;

/// The planes of the second and of the third level in each lane, and the child that is there.
struct WidePaths {
    __m256i second, third, children;

    [[gnu::always_inline]] WidePaths(const WideNode &node, unsigned downward) {
        downward &= WideOrder::sign_count - 1;
        children = _mm256_permutevar8x32_epi32(load(node.children), load_lanes(wide_order.cells[downward]));
        second = load(wide_order.second[downward & 7]);
        third = load(wide_order.third[downward & 7]);
    }

private:
    template <typename T> static __m256i load(const T *lanes) {
        return _mm256_load_si256(reinterpret_cast<const __m256i *>(lanes));
    }
};

template <> struct WideLanes<Simd::avx2> {
    [[gnu::always_inline]] static WideCut cut(const WideNode &node, const WideMeet &meet, float from, float to) {
        const WidePaths paths(node, meet.downward);
        const __m256i first = _mm256_setzero_si256();
        Float8 begin = max(begins<0x0f>(first, meet.low), Float8::all(from));
        Float8 end = min(ends<0x0f>(first, meet.high), Float8::all(to));
        begin = max(begins<0x55>(paths.third, meet.low), max(begins<0x33>(paths.second, meet.low), begin));
        end = min(ends<0x55>(paths.third, meet.high), min(ends<0x33>(paths.second, meet.high), end));
        const __m256i empty = _mm256_cmpeq_epi32(_mm256_slli_epi32(paths.children, 32 - WideChild::axis_shift), first);
        const unsigned lanes =
            unsigned(_mm256_movemask_ps(_mm256_andnot_ps(_mm256_castsi256_ps(empty), (begin <= end).v)));
        return {begin, end, paths.children, lanes};
    }

    /// The lanes of `set` moved together, in their order; anything behind them.
    [[gnu::always_inline]] static Float8 together(Float8 x, unsigned set) {
        return x[load_lanes(lane_compaction.sources[set])];
    }

private:
    /// One level: lanes in `far` begin where the ray meets their plane, the others end there. What is not a number is
    /// dropped by max and min, being their first operand.
    template <int far> [[gnu::always_inline]] static Float8 begins(__m256i planes, Float8 low) {
        return {_mm256_blend_ps(_mm256_set1_ps(-HUGE_VALF), low[planes].v, far)};
    }
    template <int far> [[gnu::always_inline]] static Float8 ends(__m256i planes, Float8 high) {
        return {_mm256_blend_ps(high[planes].v, _mm256_set1_ps(HUGE_VALF), far)};
    }
};

/// With masks instead of blended infinities, and the instruction that moves lanes together.
template <> struct WideLanes<Simd::avx512> {
    [[gnu::always_inline]] BSP_AVX512 static WideCut cut(const WideNode &node, const WideMeet &meet, float from,
                                                         float to) {
        const WidePaths paths(node, meet.downward);
        const __m256 low = meet.low.v, high = meet.high.v;
        __m256 begin = _mm256_set1_ps(from), end = _mm256_set1_ps(to);
        begin = _mm256_mask_max_ps(begin, 0x0f, _mm256_broadcastss_ps(_mm256_castps256_ps128(low)), begin);
        end = _mm256_mask_min_ps(end, 0xf0, _mm256_broadcastss_ps(_mm256_castps256_ps128(high)), end);
        begin = _mm256_mask_max_ps(begin, 0x33, _mm256_permutexvar_ps(paths.second, low), begin);
        end = _mm256_mask_min_ps(end, 0xcc, _mm256_permutexvar_ps(paths.second, high), end);
        begin = _mm256_mask_max_ps(begin, 0x55, _mm256_permutexvar_ps(paths.third, low), begin);
        end = _mm256_mask_min_ps(end, 0xaa, _mm256_permutexvar_ps(paths.third, high), end);
        const __mmask8 full =
            _mm256_test_epi32_mask(paths.children, _mm256_set1_epi32((1 << WideChild::axis_shift) - 1));
        return {{begin}, {end}, paths.children, _mm256_mask_cmp_ps_mask(full, begin, end, _CMP_LE_OQ)};
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

/// Cells that wait; of one node, the nearest on top.
template <int size> class WideStack {
public:
    bool empty() const { return m_count == 0; }
    bool has_room() const { return m_count + 7 <= size; }

    /// Takes the first `count` lanes.
    [[gnu::always_inline]] void push(__m256i children, Float8 begins, Float8 ends, int count) {
        _mm256_storeu_si256(reinterpret_cast<__m256i *>(m_children + m_count), children);
        _mm256_storeu_ps(m_begins + m_count, begins.v);
        _mm256_storeu_ps(m_ends + m_count, ends.v);
        m_count += count;
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

} // namespace bsp

// The search itself, once for each instruction set: a function only inlines what asks for no more than itself.
#define BSP_SIMD Simd::avx2
#define BSP_TARGET
#include "wide_search.h"
#undef BSP_SIMD
#undef BSP_TARGET
#define BSP_SIMD Simd::avx512
#define BSP_TARGET BSP_AVX512
#include "wide_search.h"
#undef BSP_SIMD
#undef BSP_TARGET
