#include "references.h"

#include <algorithm>

namespace bsp {
namespace {

/// Cuts a convex polygon by a plane; `heights` are its vertices' distances, some below and some above 0. Both parts
/// share the new vertices, so that together they cover the polygon.
class PolygonSplitter {
public:
    explicit PolygonSplitter(const Direction &direction, double offset) : m_direction(direction), m_offset(offset) {}

    void split(const Vec3d *polygon, std::size_t count) {
        below.clear();
        above.clear();
        Vec3d previous = polygon[count - 1];
        double before = position(m_direction, previous) - m_offset;
        for (std::size_t i = 0; i < count; ++i) {
            const Vec3d here = polygon[i];
            const double height = position(m_direction, here) - m_offset;
            if ((before < 0 && height > 0) || (before > 0 && height < 0)) {
                const Vec3d cut = crossing(previous, before, here, height);
                below.push_back(cut);
                above.push_back(cut);
            }
            if (height <= 0)
                below.push_back(here);
            if (height >= 0)
                above.push_back(here);
            previous = here;
            before = height;
        }
    }

    std::vector<Vec3d> below, above;

private:
    Vec3d crossing(Vec3d p, double p_height, Vec3d q, double q_height) const {
        if (p_height > q_height) { // the same vertex whichever way the edge is walked
            std::swap(p, q);
            std::swap(p_height, q_height);
        }
        Vec3d cut = p + (q - p) * (p_height / (p_height - q_height));
        if (m_direction.is_axis())
            cut[m_direction.major] = m_offset;
        return cut;
    }

    Direction m_direction;
    double m_offset;
};

} // namespace

void ReferenceList::reserve(std::size_t references, std::size_t vertex_count) {
    ids.reserve(references);
    starts.reserve(references + 1);
    vertices.reserve(vertex_count);
}

void ReferenceList::add(std::uint32_t id, const Vec3d *polygon, std::size_t count) {
    ids.push_back(id);
    vertices.insert(vertices.end(), polygon, polygon + count);
    starts.push_back(std::uint32_t(vertices.size()));
}

double ReferenceList::area(std::size_t i) const {
    if (is_primitive(ids[i]))
        return 0;
    Vec3d sum;
    for (std::uint32_t v = starts[i] + 2; v < starts[i + 1]; ++v)
        sum = sum + cross(vertices[v - 1] - vertices[starts[i]], vertices[v] - vertices[starts[i]]);
    return norm(sum) / 2;
}

ReferenceList make_references(const TriangleSet &set) {
    ReferenceList list;
    list.reserve(set.size(), 3 * set.valid.size() + 8 * set.primitives.size());
    for (const std::uint32_t id : set.valid) {
        const Triangle &t = set.triangles[id];
        const Vec3d polygon[3] = {to_double(t.a), to_double(t.b), to_double(t.c)};
        list.add(id, polygon, 3);
    }
    for (std::uint32_t index = 0; index < set.primitives.size(); ++index) {
        Vec3d corners[8];
        for (unsigned i = 0; i < 8; ++i)
            corners[i] = set.primitives[index].corner(i);
        list.add(primitive_id(index), corners, 8);
    }
    return list;
}

std::pair<ReferenceList, ReferenceList> split_references(const ReferenceList &references, const Direction &direction,
                                                         const SweptPlane &plane, bool clip) {
    const double offset = plane.offset, lowest = offset - plane.tolerance, highest = offset + plane.tolerance;
    std::pair<ReferenceList, ReferenceList> sides;
    auto &[below, above] = sides;
    // Each side has polygons like those of both, and a corner more where one is cut; what is added is for luck.
    const std::size_t size = std::max<std::size_t>(1, references.size());
    const std::size_t cut = plane.below + plane.above - std::min<std::size_t>(size, plane.below + plane.above);
    const double corners = 17.0 / 16 * double(references.vertices.size()) / double(size);
    below.reserve(plane.below, std::size_t(corners * plane.below) + cut + 2);
    above.reserve(plane.above, std::size_t(corners * plane.above) + cut + 2);
    PolygonSplitter splitter(direction, offset);
    for (std::size_t i = 0; i < references.size(); ++i) {
        const auto [low, high] = references.extent(i, direction);
        const std::uint32_t id = references.ids[i];
        const Vec3d *polygon = references.vertices.data() + references.starts[i];
        const std::size_t count = references.starts[i + 1] - references.starts[i];
        const bool planar = low >= lowest && high <= highest;
        if (planar ? plane.planar_below : high <= highest) {
            below.add(id, polygon, count);
        } else if (planar || low >= lowest) {
            above.add(id, polygon, count);
        } else if (!clip || is_primitive(id)) {
            below.add(id, polygon, count);
            above.add(id, polygon, count);
        } else {
            splitter.split(polygon, count);
            below.add(id, splitter.below.data(), splitter.below.size());
            above.add(id, splitter.above.data(), splitter.above.size());
        }
    }
    return sides;
}

} // namespace bsp
