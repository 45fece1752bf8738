#include "cell.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace bsp {
namespace {

/// Relative to the size of the cell: vertices nearer to a plane than this lie on it.
constexpr double on_plane = 1e-13;

double box_area(const Bounds &box) {
    const Vec3d d = box.upper - box.lower;
    return 2 * (d.x * d.y + d.y * d.z + d.z * d.x);
}

Vec3d face_vector(const Polyhedron &p, const std::uint16_t *loop, std::size_t size) {
    Vec3d sum;
    for (std::size_t i = 2; i < size; ++i)
        sum = sum + cross(p.vertices[loop[i - 1]] - p.vertices[loop[0]], p.vertices[loop[i]] - p.vertices[loop[0]]);
    return sum;
}

/// Cuts a polyhedron and collects one part.
class Clipper {
public:
    Clipper(const Polyhedron &whole, const Direction &direction, double offset)
        : m_whole(whole), m_normal(direction.normal() * (1 / norm(direction.normal()))) {
        double scale = std::abs(offset);
        for (const Vec3d &v : whole.vertices) {
            m_height.push_back(position(direction, v) - offset);
            scale = std::max(scale, std::abs(m_height.back()));
        }
        for (double &height : m_height)
            if (std::abs(height) <= on_plane * scale)
                height = 0;
    }

    bool has_both_sides() const {
        const auto [low, high] = std::minmax_element(m_height.begin(), m_height.end());
        return *low < 0 && *high > 0;
    }

    /// The part where side * height <= 0.
    Polyhedron part(double side) {
        Polyhedron result;
        m_index.assign(m_whole.vertices.size(), none);
        m_cuts.clear();
        std::vector<std::uint16_t> loop;
        for (std::size_t face = 0; face < m_whole.face_count(); ++face) {
            loop.clear();
            clip_face(face, side, result, loop);
            if (loop.size() >= 3 && !lies_in_plane(face))
                result.add_face(m_whole.normals[face], loop.data(), loop.size());
        }
        add_cap(side, result);
        return result;
    }

private:
    static constexpr std::uint16_t none = 0xffff;
    struct Cut {
        std::uint16_t inside, outside, vertex;
    };

    std::uint16_t keep(std::uint16_t v, Polyhedron &result) {
        if (m_index[v] == none) {
            m_index[v] = std::uint16_t(result.vertices.size());
            result.vertices.push_back(m_whole.vertices[v]);
        }
        return m_index[v];
    }

    std::uint16_t cut(std::uint16_t inside, std::uint16_t outside, Polyhedron &result) {
        for (const Cut &c : m_cuts)
            if (c.inside == inside && c.outside == outside)
                return c.vertex;
        const double s = m_height[inside] / (m_height[inside] - m_height[outside]);
        const Vec3d &p = m_whole.vertices[inside], &q = m_whole.vertices[outside];
        result.vertices.push_back(p + (q - p) * s);
        m_cuts.push_back({inside, outside, std::uint16_t(result.vertices.size() - 1)});
        return m_cuts.back().vertex;
    }

    void clip_face(std::size_t face, double side, Polyhedron &result, std::vector<std::uint16_t> &loop) {
        const std::size_t first = m_whole.starts[face], last = m_whole.starts[face + 1];
        std::uint16_t previous = m_whole.loops[last - 1];
        for (std::size_t i = first; i < last; ++i) {
            const std::uint16_t v = m_whole.loops[i];
            const double before = side * m_height[previous], here = side * m_height[v];
            if (before < 0 && here > 0)
                loop.push_back(cut(previous, v, result));
            else if (before > 0 && here < 0)
                loop.push_back(cut(v, previous, result));
            if (here <= 0)
                loop.push_back(keep(v, result));
            previous = v;
        }
    }

    bool lies_in_plane(std::size_t face) const {
        for (std::size_t i = m_whole.starts[face]; i < m_whole.starts[face + 1]; ++i)
            if (m_height[m_whole.loops[i]] != 0)
                return false;
        return true;
    }

    /// The new face: all vertices on the plane, in order around their middle, for the polyhedron is convex.
    void add_cap(double side, Polyhedron &result) {
        std::vector<std::uint16_t> loop;
        for (const Cut &c : m_cuts)
            loop.push_back(c.vertex);
        for (std::size_t v = 0; v < m_height.size(); ++v)
            if (m_height[v] == 0 && m_index[v] != none)
                loop.push_back(m_index[v]);
        if (loop.size() < 3)
            return;
        Vec3d middle;
        for (const std::uint16_t v : loop)
            middle = middle + result.vertices[v] * (1.0 / double(loop.size()));
        const Vec3d outward = m_normal * side;
        const Vec3d helper = std::abs(outward.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
        const Vec3d s = cross(outward, helper), t = cross(outward, s);
        std::vector<std::pair<double, std::uint16_t>> around;
        for (const std::uint16_t v : loop) {
            const Vec3d d = result.vertices[v] - middle;
            around.emplace_back(std::atan2(dot(d, t), dot(d, s)), v);
        }
        std::sort(around.begin(), around.end());
        std::transform(around.begin(), around.end(), loop.begin(), [](const auto &entry) { return entry.second; });
        result.add_face(outward, loop.data(), loop.size());
    }

    const Polyhedron &m_whole;
    Vec3d m_normal;
    std::vector<double> m_height;
    std::vector<std::uint16_t> m_index;
    std::vector<Cut> m_cuts;
};

} // namespace

void Polyhedron::add_face(const Vec3d &normal, const std::uint16_t *loop, std::size_t size) {
    loops.insert(loops.end(), loop, loop + size);
    starts.push_back(std::uint16_t(loops.size()));
    normals.push_back(normal);
    areas.push_back(std::max(0.0, 0.5 * dot(face_vector(*this, loop, size), normal)));
}

Polyhedron make_polyhedron(const Bounds &box) {
    Polyhedron p;
    for (unsigned corner = 0; corner < 8; ++corner)
        p.vertices.push_back({corner & 1 ? box.upper.x : box.lower.x, corner & 2 ? box.upper.y : box.lower.y,
                              corner & 4 ? box.upper.z : box.lower.z});
    static constexpr std::array<std::array<std::uint16_t, 4>, 6> quads{
        {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
    for (std::size_t face = 0; face < 6; ++face) {
        Vec3d normal;
        normal[face / 2] = face % 2 ? 1 : -1;
        p.add_face(normal, quads[face].data(), 4);
    }
    return p;
}

double Cell::area() const {
    if (is_box())
        return box_area(m_box);
    double total = 0;
    for (const double area : m_polyhedron.areas)
        total += area;
    return total;
}

std::pair<double, double> Cell::extent(const Direction &direction) const {
    if (is_box() && direction.is_axis())
        return {m_box.lower[direction.major], m_box.upper[direction.major]};
    if (is_box()) {
        double low = 0, high = 0;
        const Vec3d n = direction.normal();
        for (std::size_t axis = 0; axis < 3; ++axis) {
            low += n[axis] * (n[axis] > 0 ? m_box.lower[axis] : m_box.upper[axis]);
            high += n[axis] * (n[axis] > 0 ? m_box.upper[axis] : m_box.lower[axis]);
        }
        return {low, high};
    }
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (const Vec3d &v : m_polyhedron.vertices) {
        const double p = position(direction, v);
        low = std::min(low, p);
        high = std::max(high, p);
    }
    return {low, high};
}

std::optional<std::pair<Cell, Cell>> Cell::split(const Direction &direction, double offset) const {
    if (is_box() && direction.is_axis()) {
        const std::size_t axis = direction.major;
        if (!(m_box.lower[axis] < offset && offset < m_box.upper[axis]))
            return std::nullopt;
        Bounds below = m_box, above = m_box;
        below.upper[axis] = above.lower[axis] = offset;
        return std::pair{Cell(below), Cell(above)};
    }
    if (is_box())
        return Cell(make_polyhedron(m_box)).split(direction, offset);
    Clipper clipper(m_polyhedron, direction, offset);
    if (!clipper.has_both_sides())
        return std::nullopt;
    Polyhedron below = clipper.part(1), above = clipper.part(-1);
    if (below.face_count() < 4 || above.face_count() < 4)
        return std::nullopt;
    return std::pair{Cell(std::move(below)), Cell(std::move(above))};
}

void AreaProfile::reset(const Cell &cell, const Direction &direction) {
    m_knots.clear();
    m_total = 0;
    m_current = 0;
    if (cell.is_box() && direction.is_axis())
        set_box(cell.box(), direction.major);
    else if (cell.is_box())
        set_polyhedron(make_polyhedron(cell.box()), direction);
    else
        set_polyhedron(cell.polyhedron(), direction);
}

void AreaProfile::set_box(const Bounds &box, std::size_t axis) {
    const Vec3d d = box.upper - box.lower;
    const double u = d[next_axis[axis]], v = d[after_axis[axis]];
    m_knots.resize(2);
    m_knots[0].position = box.lower[axis];
    m_knots[0].faces = m_knots[0].section = u * v;
    m_knots[0].faces_slope = 2 * (u + v);
    m_knots[1].position = box.upper[axis];
    m_total = box_area(box);
}

void AreaProfile::set_polyhedron(const Polyhedron &p, const Direction &direction) {
    sort_vertices(p, direction);
    m_changes.assign(p.vertices.size(), Change{});
    const Vec3d normal = direction.normal();
    for (std::size_t face = 0; face < p.face_count(); ++face)
        add_face(p, face, normal);
    integrate();
}

void AreaProfile::sort_vertices(const Polyhedron &p, const Direction &direction) {
    const std::size_t count = p.vertices.size();
    m_order.resize(count);
    m_rank.resize(count);
    m_height.resize(count);
    for (std::size_t v = 0; v < count; ++v) {
        m_order[v] = std::uint16_t(v);
        m_height[v] = position(direction, p.vertices[v]);
    }
    std::sort(m_order.begin(), m_order.end(),
              [&](std::uint16_t x, std::uint16_t y) { return m_height[x] < m_height[y]; });
    for (std::size_t i = 0; i < count; ++i)
        m_rank[m_order[i]] = std::uint16_t(i);
}

/// What a face contributes to both areas. Planes cut it in chords along w = normal x face normal m; the chord's two
/// ends run along edges, so that each edge contributes a linear function between its ends.
void AreaProfile::add_face(const Polyhedron &p, std::size_t face, const Vec3d &normal) {
    const double length = norm(normal), base = m_height[m_order.front()];
    // Edges that rise less than this count as level: half the digits of the sums are kept whatever happens.
    const double level = 1e-8 * (m_height[m_order.back()] - base);
    const Vec3d origin = p.vertices[m_order.front()];
    const Vec3d &m = p.normals[face];
    const Vec3d w = cross(normal, m);
    const double squared = dot(w, w), cosine = dot(normal, m) / length;
    const std::uint16_t *loop = p.loops.data() + p.starts[face];
    const std::size_t size = std::size_t(p.starts[face + 1] - p.starts[face]);
    m_total += p.areas[face];
    if (squared < 1e-12 * length * length) { // the face is parallel to the planes
        std::uint16_t lowest = m_rank[loop[0]];
        for (std::size_t i = 1; i < size; ++i)
            lowest = std::min(lowest, m_rank[loop[i]]);
        m_changes[lowest].faces_jump += p.areas[face];
        m_changes[lowest].section_jump += cosine < 0 ? p.areas[face] : -p.areas[face];
        return;
    }
    std::uint16_t v = loop[size - 1];
    double v_along = dot(w, p.vertices[v] - origin);
    for (std::size_t i = 0; i < size; ++i) {
        const std::uint16_t u = loop[i];
        const double u_along = dot(w, p.vertices[u] - origin), rise = m_height[u] - m_height[v];
        if (std::abs(rise) > level) {
            // The chord's end is at start + gradient h; the face being counter-clockwise, edges going up are its far
            // end.
            const double gradient = (u_along - v_along) / rise;
            const double start = v_along - gradient * (m_height[v] - base);
            const double weight = (rise > 0 ? 1 : -1) / squared;
            const auto change = [&](std::uint16_t at, double sign) {
                Change &c = m_changes[at];
                c.slope += sign * start;
                c.curve += sign * gradient;
                c.section_slope -= sign * start * cosine;
                c.section_curve -= sign * gradient * cosine;
            };
            change(std::min(m_rank[v], m_rank[u]), weight);
            change(std::max(m_rank[v], m_rank[u]), -weight);
        }
        v = u;
        v_along = u_along;
    }
}

void AreaProfile::integrate() {
    const std::size_t count = m_order.size();
    m_knots.resize(count);
    Change sum;
    double faces = 0, section = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const Change &change = m_changes[i];
        const double h = m_height[m_order[i]] - m_height[m_order[0]];
        sum.slope += change.slope;
        sum.curve += change.curve;
        sum.section_slope += change.section_slope;
        sum.section_curve += change.section_curve;
        faces += change.faces_jump;
        section += change.section_jump;
        Knot &knot = m_knots[i];
        knot = {m_height[m_order[i]], faces,   sum.slope + sum.curve * h,
                sum.curve / 2,        section, sum.section_slope + sum.section_curve * h,
                sum.section_curve / 2};
        if (i + 1 < count) {
            const double step = m_height[m_order[i + 1]] - m_height[m_order[i]];
            faces += step * (knot.faces_slope + step * knot.faces_curve);
            section += step * (knot.section_slope + step * knot.section_curve);
        }
    }
}

} // namespace bsp
