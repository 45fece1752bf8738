/// The room that triangles take, and what Embree is told about it.
#pragma once

#include <mitsuba/core/bbox.h>
#include <mitsuba/core/logger.h>
#include <mitsuba/render/scene_ir.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "../core/triangles.h"

NAMESPACE_BEGIN(mitsuba)

/// Shapes that Mitsuba can intersect one ray and one primitive at a time, by their names in scenes.
constexpr const char *bounded_primitives = "sphere, disk, cylinder, sdfgrid and ellipsoids";
inline bool is_bounded_primitive(std::string_view class_name) {
    return class_name == "Sphere" || class_name == "Disk" || class_name == "Cylinder" || class_name == "SDFGrid" ||
           class_name == "Ellipsoids";
}

using Box3f = BoundingBox<Point<float, 3>>;

inline bool is_finite(const Box3f &box) { return dr::all(dr::isfinite(box.min) & dr::isfinite(box.max)); }

/// The triangles of a mesh, or the primitives of another shape. The box is that of those that are finite, and never the
/// mesh's own: after Mitsuba has merged rectangles that is too small.
struct Extent {
    Box3f box;
    size_t others = 0; ///< triangles with a vertex, or primitives with a box, that is not finite
};

/// Embree drops a shape that reaches beyond 1.844e18 without a word. The margin of `padded` is a 500th of this at most.
constexpr float largest_extent = 1.8e18f;

/// Throws if a box reaches too far for Embree; `name` is how the message calls what is in it.
inline void check_reach(const Box3f &box, const std::string &name) {
    if (box.valid() && !dr::all((box.min >= -largest_extent) & (box.max <= largest_extent)))
        Throw(
            "%s extends from %s to %s, but Embree, which hands us the rays, drops shapes that reach beyond %g without "
            "a word: scale the scene down",
            name, box.min, box.max, largest_extent);
}

/// Throws if a triangle refers to a vertex that does not exist, or reaches too far for Embree; `name` is how the
/// message calls the mesh.
inline Extent measure_triangles(const ShapeIR &ir, const std::string &name) {
    const float *vertices = static_cast<const float *>(ir.vertex_ptr);
    const uint32_t *faces = static_cast<const uint32_t *>(ir.index_ptr);
    Extent extent;
    for (size_t i = 0; i < ir.face_count; ++i) {
        Box3f triangle;
        bool finite = true;
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t vertex = faces[3 * i + k];
            if (vertex >= ir.vertex_count)
                Throw("%s: triangle %d refers to vertex %d, but the mesh has %d vertices", name, i, vertex,
                      ir.vertex_count);
            const auto p = dr::load<Point<float, 3>>(vertices + 3 * size_t(vertex));
            finite &= bool(dr::all(dr::isfinite(p)));
            triangle.expand(p);
        }
        if (finite)
            extent.box.expand(triangle);
        extent.others += !finite;
    }
    check_reach(extent.box, name);
    return extent;
}

/// Another shape, by the boxes of its primitives. Throws if one reaches too far.
template <typename Shape> Extent measure_primitives(const Shape &shape, const std::string &name) {
    Extent extent;
    for (uint32_t i = 0; i < shape.primitive_count(); ++i) {
        if (const Box3f box = shape.bbox(i); is_finite(box))
            extent.box.expand(box);
        else
            ++extent.others;
    }
    check_reach(extent.box, name);
    return extent;
}

/// A primitive's box with a margin for the rounding errors of its coordinates, which are about 2^-24 of them.
inline bsp::Bounds padded_primitive(const Box3f &box) {
    const double largest = std::max(dr::max(dr::abs(box.min)), dr::max(dr::abs(box.max)));
    const double margin = 0x1p-18 * largest;
    bsp::Bounds padded;
    padded.extend({box.min.x() - margin, box.min.y() - margin, box.min.z() - margin});
    padded.extend({box.max.x() + margin, box.max.y() + margin, box.max.z() + margin});
    return padded;
}

/// The box of a part of a group, with a margin that makes Embree lose no ray. `all` is the box of the whole group.
///
/// Where a ray enters and leaves a box Embree computes from products like (plane - origin) / direction, rounded to a
/// few units of 2^-24 of the coordinates of plane and origin: as if the plane were moved by as much, so that a margin
/// of that size loses no ray. Within 1000 sizes of the group (ten of a scene that is a hundred times larger)
/// coordinates are below `reach`; the box grows by a thousandth, which costs nothing.
inline Box3f padded(Box3f box, const Box3f &all) {
    if (!box.valid())
        return box;
    const float largest = std::max(dr::max(dr::abs(all.min)), dr::max(dr::abs(all.max)));
    const float reach = largest + 1000 * dr::max(all.extents());
    const float margin = 16 * 0x1p-24f * reach;
    box.min -= margin;
    box.max += margin;
    return box;
}

NAMESPACE_END(mitsuba)
