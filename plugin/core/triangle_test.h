/// The two triangle tests. Each tells, for a block, which triangles may be hit, and decides a single triangle for good;
/// brute force and every tree call the same `intersect`, so their answers have the same bits.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "direction.h"
#include "ray.h"
#include "triangle_block.h"

namespace bsp {

/// Where a ray meets a triangle's plane inside the triangle; t may be negative or beyond maxt.
struct TriangleHit {
    float t, u, v;
};

/// Watertight test of Woop, Benthin, Wald (2013): the triangle is moved and sheared so that the ray becomes the z axis;
/// the ray hits it if the three edge functions agree in sign. A vertex shared by triangles is sheared to the same point
/// in all of them, and the sign of an edge function is exact, so no ray slips between neighbours. Deviation: the paper
/// repeats in double precision when an edge function is 0. Here floats only sort out (rounding is monotonic: a float
/// edge function has the exact sign or is 0), and what is left is always decided in double, where the product of two
/// floats is exact. So t is accurate too when the triangle is seen from its edge.
class WoopTest {
public:
    explicit WoopTest(const Ray &ray) : m_origin(ray.o) {
        const Vec3f size{std::abs(ray.d.x), std::abs(ray.d.y), std::abs(ray.d.z)};
        m_z = unsigned(size.y > size.x); // no branches: they could not be predicted
        m_z += (2 - m_z) & -unsigned(size.z > std::max(size.x, size.y));
        m_x = next_axis[m_z];
        m_y = after_axis[m_z];
        m_shear_x = ray.d[m_x] / ray.d[m_z];
        m_shear_y = ray.d[m_y] / ray.d[m_z];
        m_inverse_z = 1.0 / double(ray.d[m_z]);
        m_sign_z = std::copysign(0.0f, ray.d[m_z]);
        m_reach_z = std::abs(ray.d[m_z]) * 1.0001f;
    }

    /// A set bit for every triangle but `known` that `intersect` might accept with t from 0 to `limit`, and some
    /// others.
    [[gnu::always_inline]] unsigned candidates(const TriangleBlock &block, float limit, std::uint32_t known) const {
        const Float8 ox = Float8::all(m_origin[m_x]), oy = Float8::all(m_origin[m_y]), oz = Float8::all(m_origin[m_z]);
        const Float8 sx = Float8::all(m_shear_x), sy = Float8::all(m_shear_y);
        Float8 x[3], y[3], z[3];
        for (unsigned i = 0; i < 3; ++i) {
            const Float8 depth = block.load(i, m_z) - oz;
            x[i] = fnmadd(sx, depth, block.load(i, m_x) - ox);
            y[i] = fnmadd(sy, depth, block.load(i, m_y) - oy);
            z[i] = {_mm256_xor_ps(depth.v, _mm256_set1_ps(m_sign_z))};
        }
        const Float8 beyond = min(min(z[0], z[1]), z[2]) > Float8::all(limit * m_reach_z),
                     behind = max(max(z[0], z[1]), z[2]) < Float8::all(0);
        const Float8 u = x[2] * y[1] - y[2] * x[1];
        const Float8 v = x[0] * y[2] - y[0] * x[2];
        const Float8 w = x[1] * y[0] - y[1] * x[0];
        const Float8 zero = Float8::all(0);
        const Float8 outside = (min(min(u, v), w) < zero) & (max(max(u, v), w) > zero);
        return (1u << TriangleBlock::width) - 1 -
               (outside | beyond | behind | block.lanes_of(known) | block.lanes_of(no_triangle)).bits();
    }

    template <typename Corners> std::optional<TriangleHit> intersect(const Corners &corners) const {
        const Sheared a = shear(corners, 0), b = shear(corners, 1), c = shear(corners, 2);
        const double u = c.x * b.y - c.y * b.x, v = a.x * c.y - a.y * c.x, w = b.x * a.y - b.y * a.x;
        if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0))
            return std::nullopt;
        const double determinant = u + v + w;
        if (!(determinant != 0)) // seen from its edge, or not a number
            return std::nullopt;
        const double t = (u * a.z + v * b.z + w * c.z) * m_inverse_z; // times the determinant
        if (t * determinant < 0)
            return std::nullopt;
        const double inverse = 1 / determinant;
        return TriangleHit{float(t * inverse), float(v * inverse), float(w * inverse)};
    }

private:
    struct Sheared {
        double x, y, z; ///< floats, kept as doubles for their products
    };

    template <typename Corners> Sheared shear(const Corners &corners, unsigned i) const {
        const float z = corners(i, m_z) - m_origin[m_z];
        return {fnmadd(m_shear_x, z, corners(i, m_x) - m_origin[m_x]),
                fnmadd(m_shear_y, z, corners(i, m_y) - m_origin[m_y]), z};
    }

    Vec3f m_origin;
    unsigned m_x = 0, m_y = 0, m_z = 0;
    float m_shear_x, m_shear_y;
    double m_inverse_z;
    float m_sign_z, m_reach_z;
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

    unsigned candidates(const TriangleBlock &block, float limit, std::uint32_t known) const {
        Vec3<Float8> corners[3];
        for (unsigned vertex = 0; vertex < 3; ++vertex)
            corners[vertex] = {block.load(vertex, 0), block.load(vertex, 1), block.load(vertex, 2)};
        const auto [hit, inside] = test<Float8>(all(m_origin), all(m_direction), corners[0], corners[1], corners[2]);
        return (inside & (hit.z >= Float8::all(0)) & (hit.z <= Float8::all(limit))).bits() &
               ~(block.lanes_of(known) | block.lanes_of(no_triangle)).bits();
    }

    template <typename Corners> std::optional<TriangleHit> intersect(const Corners &corners) const {
        const auto corner = [&](unsigned i) { return Vec3f{corners(i, 0), corners(i, 1), corners(i, 2)}; };
        const auto [hit, inside] = test<float>(m_origin, m_direction, corner(0), corner(1), corner(2));
        return inside ? std::optional(TriangleHit{hit.z, hit.x, hit.y}) : std::nullopt;
    }

private:
    Vec3f m_origin, m_direction;
};

} // namespace bsp
