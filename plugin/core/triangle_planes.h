/// Planes along triangles: the candidates of Ize, Wald, Parker, "Ray Tracing with the BSP Tree" (2008), besides the
/// axes.
#pragma once

#include <array>
#include <optional>

#include "cell.h"
#include "references.h"
#include "settings.h"

namespace bsp {

/// A plane with the float coefficients that are stored and traversed.
struct TrianglePlane {
    Direction direction;
    float offset = 0;
};

/// The triangle's own plane, and those through its edges ab, bc, ca perpendicular to it. Rounded to floats: the three
/// vertices, or the two of the edge, lie within `plane_tolerance` of it.
std::array<TrianglePlane, 4> planes_along(const Triangle &triangle);

/// How far off a plane of its own a triangle may lie by rounding, as a position along the plane's normal, anywhere in
/// the box: references are on the plane up to this distance, and rays must be told. With u = 2^-24 and S the sum over
/// the axes of the largest |coordinate|: the offset is rounded by u S at most, the two slopes by u / 2 each; positions
/// of the vertices so differ by u S at most, by half of that from their middle, which is the offset.
double plane_tolerance(const Bounds &box);

struct PlaneCandidate {
    Direction direction;
    SweptPlane plane;
};

/// The cheapest of the planes along the node's triangles, or along `most` of them evenly spread over the list, if one
/// costs less than `limit`; ties go to the triangle listed first. Planes along the axes are left to the sweep, which
/// sees them too; so are slices of the cell that are no thicker than the tolerance.
std::optional<PlaneCandidate> best_triangle_plane(const TriangleSet &set, const ReferenceList &references,
                                                  const Cell &cell, const CostModel &cost, double tolerance,
                                                  double limit, std::size_t most = SIZE_MAX);

} // namespace bsp
