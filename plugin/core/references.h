/// The triangles of a node, clipped to its cell: they live only while the tree is built.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "direction.h"
#include "triangles.h"

namespace bsp {

/// References to primitives are not clipped: they are the eight corners of a box.
/// Any other reference i is the convex polygon `vertices[starts[i]] .. vertices[starts[i + 1] - 1]`: the part of
/// triangle `ids[i]` inside the cell, in double precision. Ids are distinct.
struct ReferenceList {
    std::vector<std::uint32_t> ids;
    std::vector<std::uint32_t> starts{0};
    std::vector<Vec3d> vertices;

    std::size_t size() const { return ids.size(); }
    void reserve(std::size_t references, std::size_t vertex_count);
    void add(std::uint32_t id, const Vec3d *polygon, std::size_t count);

    /// Smallest and largest position of reference `i` along `direction`. Inline: most of building is this.
    std::pair<double, double> extent(std::size_t i, const Direction &direction) const {
        double low = HUGE_VAL, high = -HUGE_VAL;
        for (std::uint32_t v = starts[i]; v < starts[i + 1]; ++v) {
            const double p = position(direction, vertices[v]);
            low = std::min(low, p);
            high = std::max(high, p);
        }
        return {low, high};
    }

    /// Area of reference `i`, as far as it is inside the cell; 0 of a primitive.
    double area(std::size_t i) const;
};

/// References to all valid triangles and all primitives, not clipped.
ReferenceList make_references(const TriangleSet &set);

/// A plane across a node, as the sweep finds it.
struct SweptPlane {
    float offset = 0;
    bool planar_below = false;          ///< triangles in the plane go below (else above): the cheaper side
    std::uint32_t below = 0, above = 0; ///< references on either side
    double cost = 0;                    ///< of both children's triangles, the step itself not included
    double tolerance = 0;               ///< what is nearer to the plane than this, as a position, lies in it
};

/// The references on either side of a plane. What touches the plane with an edge or a vertex only stays on its side;
/// what crosses it is cut, or with `clip` false goes to both sides whole; what lies in it goes below or above as a
/// whole. Parts that reach beyond the plane by no more than its tolerance do not count: a reference may protrude from
/// its cell by that much.
std::pair<ReferenceList, ReferenceList> split_references(const ReferenceList &references, const Direction &direction,
                                                         const SweptPlane &plane, bool clip = true);

} // namespace bsp
