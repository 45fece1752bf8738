/// The axes of a tree: the user's x, y and z, or three perpendicular ones found in the scene, so that a scene which
/// stands askew is split like one that does not. Cells, planes and the ray that is followed through them are seen in
/// these axes; triangles are tested where the user put them, by the user's ray, so that no answer depends on them.
#pragma once

#include <immintrin.h>

#include <array>

#include "triangles.h"

namespace bsp {

struct Facing;
struct Plane;

class Orientation {
public:
    /// The user's axes.
    Orientation() = default;
    /// `axes`: perpendicular, of length 1. `origin`: the point that is seen as 0.
    Orientation(const std::array<Vec3d, 3> &axes, const Vec3d &origin);

    bool turns() const { return m_turns; }
    std::array<Vec3d, 3> axes() const;
    Vec3d origin() const { return {m_origin[0], m_origin[1], m_origin[2]}; }

    /// A point as it is seen in these axes.
    Vec3d seen(const Vec3d &point) const;
    /// A box around all that is seen of a box.
    Bounds seen(const Bounds &box) const;
    /// All of `set`: its triangles, rounded to floats, and the boxes around its boxes. Invalid triangles are left at 0.
    TriangleSet seen(const TriangleSet &set) const;
    /// The plane that is seen as `plane`, as far as floats tell it.
    Plane unseen(const Plane &plane) const;

    /// How far what a triangle test reports may be from the triangle, along an axis of these, in units of 2^-24 of the
    /// largest distance along an axis from the ray's origin to the scene's box: see traversal.h.
    float hit_error() const { return m_turns ? 32 : 8; }

    /// A ray's origin and direction. The fourth number of the direction, which is maxt, stays as it is.
    struct Line {
        __m128 o, d;
    };
    [[gnu::always_inline]] Line seen(__m128 o, __m128 d) const {
        if (!m_turns)
            return {o, d};
        const __m256d direction = _mm256_cvtps_pd(d);
        const __m256d from = _mm256_sub_pd(_mm256_cvtps_pd(o), _mm256_load_pd(m_origin));
        return {_mm256_cvtpd_ps(along_axes(from)), _mm_blend_ps(_mm256_cvtpd_ps(along_axes(direction)), d, 8)};
    }

private:
    [[gnu::always_inline]] __m256d along_axes(__m256d v) const {
        const __m256d x = _mm256_permute4x64_pd(v, 0), y = _mm256_permute4x64_pd(v, 0b01010101),
                      z = _mm256_permute4x64_pd(v, 0b10101010);
        return _mm256_fmadd_pd(
            _mm256_load_pd(m_columns[0]), x,
            _mm256_fmadd_pd(_mm256_load_pd(m_columns[1]), y, _mm256_mul_pd(_mm256_load_pd(m_columns[2]), z)));
    }

    alignas(32) double m_columns[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}; ///< what x, y and z add to each
    alignas(32) double m_origin[4] = {0, 0, 0, 0};
    bool m_turns = false;
};

/// The axes along which most of the area faces: the normal of the largest triangle of the direction that has most area,
/// and of those perpendicular to it the same again, the best pair of several. The user's own if these are it, if
/// there is no triangle, or if less than `least_share` of the area of `facings` lies along what is found. The same for
/// the same triangles. The second is to be called in the floating-point environment of the standard (StandardFloats).
Orientation find_orientation(const TriangleSet &set);
Orientation find_orientation(const TriangleSet &set, const std::vector<Facing> &facings, double least_share);

/// Normals this near to an axis (as a cosine) lie along it.
constexpr double axis_cosine = 0.9999;

/// Share of the area whose normals lie along these axes.
double axis_share(const TriangleSet &set, const Orientation &orientation = {});

} // namespace bsp
