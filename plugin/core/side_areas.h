/// The surface areas of both parts of a cell for single planes of any direction, where `AreaProfile` would be set up
/// for one plane only.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "cell.h"

namespace bsp {

class SideAreas {
public:
    explicit SideAreas(const Cell &cell);

    /// Areas of the parts below and above; nothing if one of them reaches no further than `margin` from the plane.
    /// `heights` is scratch.
    std::optional<std::pair<double, double>> at(const Direction &direction, double offset, double margin,
                                                std::vector<double> &heights) const;

    double total() const { return m_total; }

private:
    double area_below(std::size_t face, const double *heights) const;

    Polyhedron m_cell;
    std::vector<double> m_edges; ///< of each loop's edges: twice the area of the triangle with the loop's first vertex
    double m_total = 0;
};

} // namespace bsp
