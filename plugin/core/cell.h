/// The convex region of a node while the tree is built: its extent, its surface, and what a plane makes of them.
/// A cell is a box until the first oblique cut and a general polyhedron from then on. Double precision.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "direction.h"
#include "triangles.h"

namespace bsp {

/// A closed convex polyhedron. Face i has the outward unit normal `normals[i]` and the vertex loop
/// `loops[starts[i]] .. loops[starts[i + 1] - 1]`, counter-clockwise seen from outside.
struct Polyhedron {
    std::vector<Vec3d> vertices;
    std::vector<Vec3d> normals;
    std::vector<double> areas;
    std::vector<std::uint16_t> starts{0}, loops;

    std::size_t face_count() const { return normals.size(); }
    void add_face(const Vec3d &normal, const std::uint16_t *loop, std::size_t size);
};

Polyhedron make_polyhedron(const Bounds &box);

/// The convex region of a node.
class Cell {
public:
    explicit Cell(const Bounds &box) : m_box(box) {}

    /// Total surface area.
    double area() const;

    /// Smallest and largest position along `direction`.
    std::pair<double, double> extent(const Direction &direction) const;

    /// The parts below and above the plane; nothing if the plane leaves one of them without a surface.
    std::optional<std::pair<Cell, Cell>> split(const Direction &direction, double offset) const;

    bool is_box() const { return m_polyhedron.vertices.empty(); }
    const Bounds &box() const { return m_box; } ///< meaningful for boxes only
    const Polyhedron &polyhedron() const { return m_polyhedron; }

private:
    explicit Cell(Polyhedron polyhedron) : m_polyhedron(std::move(polyhedron)) {}

    Bounds m_box;
    Polyhedron m_polyhedron;
};

/// The surface areas of both parts of a cell as a function of the offset of a plane that sweeps through it along one
/// direction. Between the positions of the cell's vertices they are quadratic, so that after a set-up over the vertices
/// each plane costs O(1) (the idea of Budge, Coming, Norpchen, Joy 2008 for fixed directions, here for any cell).
class AreaProfile {
public:
    /// Sets up for another cell and direction; memory is kept from one to the next.
    void reset(const Cell &cell, const Direction &direction);

    double lower() const { return m_knots.front().position; }
    double upper() const { return m_knots.back().position; }

    /// Areas of the parts below and above `offset`. Offsets must not decrease from call to call.
    std::pair<double, double> at(double offset) {
        while (m_current + 1 < m_knots.size() && m_knots[m_current + 1].position <= offset)
            ++m_current;
        const Knot &k = m_knots[m_current];
        const double x = offset - k.position;
        const double faces = std::clamp(k.faces + x * (k.faces_slope + x * k.faces_curve), 0.0, m_total);
        const double section = std::max(0.0, k.section + x * (k.section_slope + x * k.section_curve));
        return {faces + section, m_total - faces + section};
    }

private:
    /// From one vertex to the next: areas are `value + slope x + curve x^2`, x the distance from `position`.
    struct Knot {
        double position = 0;
        double faces = 0, faces_slope = 0, faces_curve = 0;       ///< area of the cell's faces below
        double section = 0, section_slope = 0, section_curve = 0; ///< area of the cross-section
    };

    /// What changes at a vertex: jumps of the two areas, and their derivatives as linear functions of the height above
    /// the lowest vertex.
    struct Change {
        double faces_jump = 0, section_jump = 0, slope = 0, curve = 0, section_slope = 0, section_curve = 0;
    };

    void set_box(const Bounds &box, std::size_t axis);
    void set_polyhedron(const Polyhedron &polyhedron, const Direction &direction);
    void sort_vertices(const Polyhedron &polyhedron, const Direction &direction);
    void add_face(const Polyhedron &polyhedron, std::size_t face, const Vec3d &normal);
    void integrate();

    std::vector<Knot> m_knots;
    double m_total = 0;
    std::size_t m_current = 0;

    std::vector<std::uint16_t> m_order, m_rank; ///< vertices by height, and back
    std::vector<double> m_height;
    std::vector<Change> m_changes;
};

} // namespace bsp
