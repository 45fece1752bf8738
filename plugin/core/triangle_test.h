/// The two triangle tests. Each tells, for a block, which triangles may be hit, and decides a single triangle for good;
/// brute force and every tree call the same `intersect`, so their answers have the same bits.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "direction.h"
#include "ray.h"
#include "triangle_block.h"

namespace bsp {

/// Where a ray meets a triangle: t, u and v in lanes 0, 1 and 2; t may be negative or beyond maxt. Where it misses the
/// triangle, t is not a number.
struct TriangleHit {
    __m128 tuv;

    float t() const { return _mm_cvtss_f32(tuv); }
    float u() const { return _mm_cvtss_f32(_mm_permute_ps(tuv, 1)); }
    float v() const { return _mm_cvtss_f32(_mm_permute_ps(tuv, 2)); }
    bool found() const { return !std::isnan(t()); }
};

/// Watertight test of Woop, Benthin, Wald (2013): the triangle is moved and sheared so that the ray becomes the z axis;
/// the ray hits it if the three edge functions agree in sign. A vertex shared by triangles is sheared to the same point
/// in all of them, and the sign of an edge function is exact, so no ray slips between neighbours. Deviation: the paper
/// repeats in double precision when an edge function is 0. Here floats only sort out (rounding is monotonic: a float
/// edge function has the exact sign or is 0), and what is left is always decided in double, where the product of two
/// floats is exact. So t is accurate too when the triangle is seen from its edge.
class WoopTest {
public:
    [[gnu::always_inline]] explicit WoopTest(const Ray &ray) {
        const Vec3f size{std::abs(ray.d.x), std::abs(ray.d.y), std::abs(ray.d.z)};
        m_z = std::size_t(size.y > size.x); // no branches: they could not be predicted
        m_z += (2 - m_z) & -std::size_t(size.z > std::max(size.x, size.y));
        m_x = next_axis[m_z];
        m_y = after_axis[m_z];
        m_shear_x = Float8::all(ray.d[m_x] / ray.d[m_z]);
        m_shear_y = Float8::all(ray.d[m_y] / ray.d[m_z]);
        m_toward = Float8::all(std::copysign(0.f, ray.d[m_z]));
        m_inverse_z = 1.0 / double(ray.d[m_z]);
        m_origin_x = Float8::all(ray.o[m_x]);
        m_origin_y = Float8::all(ray.o[m_y]);
        m_origin_z = Float8::all(ray.o[m_z]);
    }

    /// Eight triangles as the ray sees them, and their edge functions.
    struct Edges {
        Float8 x[3], y[3], z[3], u, v, w;
        Float8 none_negative, none_positive; ///< of u, v and w

        /// Whether the ray's line may hit a triangle.
        Float8 inside() const { return none_negative | none_positive; }
    };

    [[gnu::always_inline]] Edges edges(const TriangleBlock &block) const {
        Edges e;
        const float *const x = block.axis(m_x), *const y = block.axis(m_y), *const z = block.axis(m_z);
        for (std::size_t i = 0; i < 3; ++i) {
            const std::size_t vertex = i * TriangleBlock::vertex_size;
            e.z[i] = Float8::load(z + vertex) - m_origin_z;
            e.x[i] = fnmadd(m_shear_x, e.z[i], Float8::load(x + vertex) - m_origin_x);
            e.y[i] = fnmadd(m_shear_y, e.z[i], Float8::load(y + vertex) - m_origin_y);
        }
        e.u = e.x[2] * e.y[1] - e.y[2] * e.x[1];
        e.v = e.x[0] * e.y[2] - e.y[0] * e.x[2];
        e.w = e.x[1] * e.y[0] - e.y[1] * e.x[0];
        e.none_negative = min(min(e.u, e.v), e.w) >= Float8::all(0);
        e.none_positive = max(max(e.u, e.v), e.w) <= Float8::all(0);
        return e;
    }

    /// A set bit for every triangle of the block that the ray's line may hit, and for few others.
    [[gnu::always_inline]] unsigned candidates(const TriangleBlock &block) const {
        return edges(block).inside().bits();
    }

    static constexpr float moment_units = 32; ///< 24 and what rounding may take from them

    /// Whether the ray's line certainly hits a triangle behind the ray's origin, if it hits it: most rays start on a
    /// surface, which is there, as are those close behind it. t has the sign of d_z (u z_0 + v z_1 + w z_2) / (u + v +
    /// w). Let X, Y and Z be the largest size of an x, a y and a z, and the unit 2^-24 X Y: an edge function errs by 4
    /// units, the sum by 12 Z for that and by 12 Z for its own products and sums; `moment_units` is what to allow. What
    /// is flushed to zero is below 2^-80 Z, and 2^-40 more than Z keeps t from being so near to 0 that it is rounded to
    /// -0, which is a hit: error-analysis.md.
    [[gnu::always_inline]] Float8 behind(const Edges &e, Float8 largest_x, Float8 largest_y, Float8 largest_z,
                                         float units) const {
        const Float8 moment = fmadd(e.w, e.z[2], fmadd(e.v, e.z[1], e.u * e.z[0]));
        const Float8 unit = fmadd(largest_x * largest_y, Float8::all(-units * 0x1p-24f), Float8::all(-0x1p-80f));
        const Float8 least = unit * (largest_z + Float8::all(0x1p-40f));
        return (moment ^ m_toward ^ Float8::all(-0.0f).and_not(e.none_negative)) < least;
    }

    /// `likely_missed`: most triangles are, so that a branch pays; in a leaf it can hardly be predicted.
    template <bool likely_missed = false, typename Corners>
    [[gnu::always_inline]] TriangleHit intersect(const Corners &corners) const {
        const __m128 z = _mm_sub_ps(along(corners, m_z), half(m_origin_z));
        const __m128 x = _mm_fnmadd_ps(half(m_shear_x), z, _mm_sub_ps(along(corners, m_x), half(m_origin_x)));
        const __m128 y = _mm_fnmadd_ps(half(m_shear_y), z, _mm_sub_ps(along(corners, m_y), half(m_origin_y)));
        const __m256d edges = _mm256_sub_pd(_mm256_mul_pd(cab(x), bca(y)), _mm256_mul_pd(cab(y), bca(x))); // u, v, w
        const int negative = _mm256_movemask_pd(_mm256_cmp_pd(edges, _mm256_setzero_pd(), _CMP_LT_OQ));
        const int positive = _mm256_movemask_pd(_mm256_cmp_pd(edges, _mm256_setzero_pd(), _CMP_GT_OQ));
        if (likely_missed && negative != 0 && positive != 0)
            return {_mm_set1_ps(NAN)};
        const int outside = -int((negative != 0) & (positive != 0)); // all bits, which are not a number, or none
        // Where the triangle is seen from its edge the determinant is 0, and so is what it divides.
        const double inverse = 1 / sum(edges);
        const double t = sum(_mm256_mul_pd(edges, _mm256_cvtps_pd(z))) * m_inverse_z;
        const __m256d scaled = _mm256_mul_pd(_mm256_blend_pd(edges, _mm256_set1_pd(t), 1), _mm256_set1_pd(inverse));
        return {_mm_or_ps(_mm256_cvtpd_ps(scaled), _mm_castsi128_ps(_mm_cvtsi32_si128(outside)))};
    }

private:
    /// A coordinate of the three vertices; lane 3 repeats the last.
    template <typename Corners> static __m128 along(const Corners &corners, std::size_t axis) {
        const unsigned k = unsigned(axis);
        return _mm_setr_ps(corners(0, k), corners(1, k), corners(2, k), corners(2, k));
    }
    static __m128 half(Float8 x) { return _mm256_castps256_ps128(x.v); }
    // Floats kept as doubles for their products; lane 3 repeats one of them, so that it has no sign of its own.
    static __m256d cab(__m128 x) { return _mm256_cvtps_pd(_mm_permute_ps(x, 0b01010010)); }
    static __m256d bca(__m128 x) { return _mm256_cvtps_pd(_mm_permute_ps(x, 0b00001001)); }
    /// Of lanes 0, 1 and 2, in this order.
    static double sum(__m256d x) {
        const __m128d low = _mm256_castpd256_pd128(x);
        return _mm_cvtsd_f64(low) + _mm_cvtsd_f64(_mm_unpackhi_pd(low, low)) +
               _mm_cvtsd_f64(_mm256_extractf128_pd(x, 1));
    }

    std::size_t m_x, m_y, m_z;
    Float8 m_origin_x, m_origin_y, m_origin_z, m_shear_x, m_shear_y, m_toward; ///< each in all lanes
    double m_inverse_z;
};

/// The test of Mitsuba's `Mesh` (Moeller, Trumbore 1997), operation by operation, fused where Mitsuba's is.
class MtTest {
    static Vec3<Float8> all(const Vec3f &p) { return {Float8::all(p.x), Float8::all(p.y), Float8::all(p.z)}; }

    template <typename T> static T constant(float x) {
        if constexpr (std::is_same_v<T, float>)
            return x;
        else
            return T::all(x);
    }

    template <typename T> static Vec3<T> fused_cross(const Vec3<T> &a, const Vec3<T> &b) {
        return {fmsub(a.y, b.z, a.z * b.y), fmsub(a.z, b.x, a.x * b.z), fmsub(a.x, b.y, a.y * b.x)};
    }
    /// Not fused: in Mitsuba a dot product is one instruction (dpps) over four components, the last of them 0.
    template <typename T> static T dot(const Vec3<T> &a, const Vec3<T> &b) {
        return (a.x * b.x + a.y * b.y) + (a.z * b.z + constant<T>(0));
    }
    /// ((u, v, t), whether u and v are inside).
    template <typename T>
    static auto test(const Vec3<T> &o, const Vec3<T> &d, const Vec3<T> &a, const Vec3<T> &b, const Vec3<T> &c) {
        const Vec3<T> e1 = b - a, e2 = c - a, p = fused_cross(d, e2);
        const T inverse = constant<T>(1) / dot(e1, p);
        const Vec3<T> s = o - a, q = fused_cross(s, e1);
        const T u = dot(s, p) * inverse, v = dot(d, q) * inverse, t = dot(e2, q) * inverse;
        const T zero = constant<T>(0), one = constant<T>(1);
        return std::pair{Vec3<T>{u, v, t}, (u >= zero) & (u <= one) & (v >= zero) & (u + v <= one)};
    }

public:
    explicit MtTest(const Ray &ray) : m_origin(ray.o), m_direction(ray.d) {}

    /// A set bit for every triangle of the block that the ray hits.
    unsigned candidates(const TriangleBlock &block) const {
        Vec3<Float8> corners[3];
        for (unsigned vertex = 0; vertex < 3; ++vertex)
            corners[vertex] = {block.load(vertex, 0), block.load(vertex, 1), block.load(vertex, 2)};
        const auto [hit, inside] = test<Float8>(all(m_origin), all(m_direction), corners[0], corners[1], corners[2]);
        return (inside & (hit.z >= Float8::all(0))).bits();
    }

    template <bool /*likely_missed*/ = false, typename Corners> TriangleHit intersect(const Corners &corners) const {
        const auto corner = [&](unsigned i) { return Vec3f{corners(i, 0), corners(i, 1), corners(i, 2)}; };
        const auto [hit, inside] = test<float>(m_origin, m_direction, corner(0), corner(1), corner(2));
        return {inside ? _mm_setr_ps(hit.z, hit.x, hit.y, 0) : _mm_set1_ps(NAN)};
    }

private:
    Vec3f m_origin, m_direction;
};

} // namespace bsp
