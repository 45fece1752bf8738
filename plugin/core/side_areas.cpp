#include "side_areas.h"

#include <algorithm>
#include <cmath>

namespace bsp {

SideAreas::SideAreas(const Cell &cell) : m_cell(cell.is_box() ? make_polyhedron(cell.box()) : cell.polyhedron()) {
    for (const double area : m_cell.areas)
        m_total += area;
    for (std::size_t face = 0; face < m_cell.face_count(); ++face) {
        const std::size_t first = m_cell.starts[face], last = m_cell.starts[face + 1];
        const Vec3d &origin = m_cell.vertices[m_cell.loops[first]];
        Vec3d p = m_cell.vertices[m_cell.loops[last - 1]] - origin;
        for (std::size_t i = first; i < last; ++i) {
            const Vec3d q = m_cell.vertices[m_cell.loops[i]] - origin;
            m_edges.push_back(dot(cross(p, q), m_cell.normals[face]));
            p = q;
        }
    }
}

std::optional<std::pair<double, double>> SideAreas::at(const Direction &direction, double offset, double margin,
                                                       std::vector<double> &heights) const {
    const std::size_t count = m_cell.vertices.size();
    heights.resize(count);
    double low = 0, high = 0;
    for (std::size_t v = 0; v < count; ++v) {
        const double height = position(direction, m_cell.vertices[v]) - offset;
        heights[v] = height;
        low = std::min(low, height);
        high = std::max(high, height);
    }
    if (!(low < -margin && high > margin))
        return std::nullopt;

    // The area vectors of a closed surface sum to zero: those of the faces below give that of the cross-section.
    double below = 0;
    Vec3d section;
    for (std::size_t face = 0; face < m_cell.face_count(); ++face) {
        const double area = area_below(face, heights.data());
        below += area;
        section = section + m_cell.normals[face] * area;
    }
    const double cut = norm(section);
    return std::pair{below + cut, std::max(0.0, m_total - below) + cut};
}

/// Area of the part of a face at negative heights.
double SideAreas::area_below(std::size_t face, const double *heights) const {
    const std::size_t first = m_cell.starts[face], last = m_cell.starts[face + 1];
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (std::size_t i = first; i < last; ++i) {
        low = std::min(low, heights[m_cell.loops[i]]);
        high = std::max(high, heights[m_cell.loops[i]]);
    }
    if (high <= 0)
        return m_cell.areas[face];
    if (low >= 0)
        return 0;
    // The edges below, cut at the plane where they cross it, and the cut itself make a polygon. A part of an edge spans
    // that part of its triangle.
    const Vec3d &origin = m_cell.vertices[m_cell.loops[first]];
    double twice = 0;
    Vec3d leaving, entering;
    std::uint16_t u = m_cell.loops[last - 1];
    for (std::size_t i = first; i < last; ++i) {
        const std::uint16_t v = m_cell.loops[i];
        const double before = heights[u], here = heights[v];
        if (before < 0 && here < 0) {
            twice += m_edges[i];
        } else if (before < 0 || here < 0) {
            const double part = before / (before - here);
            const Vec3d &p = m_cell.vertices[u], &q = m_cell.vertices[v];
            const Vec3d crossing = p + (q - p) * part - origin;
            (before < 0 ? leaving : entering) = crossing;
            twice += m_edges[i] * (before < 0 ? part : 1 - part);
        }
        u = v;
    }
    return std::max(0.0, (twice + dot(cross(leaving, entering), m_cell.normals[face])) / 2);
}

} // namespace bsp
