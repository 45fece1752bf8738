#include "triangle_planes.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "parallel.h"
#include "reference_hierarchy.h"
#include "side_areas.h"

namespace bsp {
namespace {

/// A node's triangles are tried in so many tasks at most, each in order, whatever thread does it. Few, for each does at
/// least one plane's work and starts without a price to beat.
constexpr std::size_t max_tasks = 16, triangles_per_task = 256;

/// References that may be looked at one by one for each triangle of a node of `count`, on average: more than nearly all
/// nodes of meshes need, where the triangles near a plane are a smaller part the more there are. Where many lie in one
/// plane, or in one place, all would be looked at for every plane.
double work_per_triangle(std::size_t count) { return 16 + 10000 / std::sqrt(double(count)); }

/// Tries planes and keeps the cheapest.
class PlaneSearch {
public:
    PlaneSearch(const ReferenceHierarchy &hierarchy, const SideAreas &areas, const CostModel &cost, double tolerance,
                double limit)
        : m_hierarchy(hierarchy), m_areas(areas), m_tolerance(tolerance), m_scale(1 / areas.total()), m_cost(cost),
          m_limit(limit) {}

    void consider(const TrianglePlane &plane) {
        if (plane.direction.is_axis())
            return;
        const auto areas = m_areas.at(plane.direction, plane.offset, 2 * m_tolerance, m_heights);
        if (!areas)
            return;
        const SidePrices prices{m_scale * areas->first, m_scale * areas->second, m_cost, m_limit};
        if (prices.is_out({}, m_hierarchy.size()))
            return;
        const auto counts = m_hierarchy.count(plane.direction, plane.offset, prices, m_scratch);
        if (!counts)
            return;
        for (const bool planar_below : {false, true}) {
            const std::uint32_t below = counts->below + (planar_below ? counts->on : 0);
            const std::uint32_t above = counts->above + (planar_below ? 0 : counts->on);
            const double price = prices.price(below, above);
            if (price >= m_limit)
                continue;
            m_limit = price;
            best = PlaneCandidate{plane.direction, {plane.offset, planar_below, below, above, price, m_tolerance}};
        }
    }

    std::optional<PlaneCandidate> best;

    /// References looked at one by one.
    std::size_t work() const { return m_scratch.work; }

private:
    const ReferenceHierarchy &m_hierarchy;
    const SideAreas &m_areas;
    double m_tolerance, m_scale;
    const CostModel &m_cost;
    double m_limit;                ///< price of the best plane so far
    std::vector<double> m_heights; ///< scratch
    ReferenceHierarchy::Scratch m_scratch;
};

} // namespace

std::array<TrianglePlane, 4> planes_along(const Triangle &triangle) {
    const std::array<Vec3d, 3> corners{to_double(triangle.a), to_double(triangle.b), to_double(triangle.c)};
    const Vec3d normal = scaled_normal(triangle);
    std::array<TrianglePlane, 4> planes;
    planes[0].direction = make_direction(normal);
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (const Vec3d &corner : corners) {
        low = std::min(low, position(planes[0].direction, corner));
        high = std::max(high, position(planes[0].direction, corner));
    }
    planes[0].offset = float((low + high) / 2);
    for (std::size_t i = 0; i < 3; ++i) {
        const Vec3d &p = corners[i], &q = corners[next_axis[i]];
        const Direction direction = make_direction(cross(normal, q - p));
        planes[i + 1] = {direction, float((position(direction, p) + position(direction, q)) / 2)};
    }
    return planes;
}

double plane_tolerance(const Bounds &box) {
    double sum = 0;
    if (!box.empty())
        for (std::size_t axis = 0; axis < 3; ++axis)
            sum += std::max(std::abs(box.lower[axis]), std::abs(box.upper[axis]));
    return 2 * 0x1p-24 * sum;
}

std::optional<PlaneCandidate> best_triangle_plane(const TriangleSet &set, const ReferenceList &references,
                                                  const Cell &cell, const CostModel &cost, double tolerance,
                                                  double limit, std::size_t most) {
    const ReferenceHierarchy hierarchy(references, tolerance);
    const SideAreas areas(cell);
    const std::size_t count = references.size(), tried = std::min(count, most);
    const auto place = [&](std::size_t i) { return count * i / tried; };
    const auto search_range = [&](std::size_t begin, std::size_t end) {
        PlaneSearch search(hierarchy, areas, cost, tolerance, limit);
        const double most_work = work_per_triangle(references.size()) * double(end - begin);
        for (std::size_t i = begin; i < end; ++i) {
            const Triangle &triangle = set.triangles[references.ids[place(i)]];
            if (i > begin && std::memcmp(&triangle, &set.triangles[references.ids[place(i - 1)]], sizeof triangle) == 0)
                continue; // one on top of the other
            for (const TrianglePlane &plane : planes_along(triangle)) {
                search.consider(plane);
                if (double(search.work()) > most_work)
                    return search.best;
            }
        }
        return search.best;
    };
    const std::size_t tasks = std::min(max_tasks, (tried + triangles_per_task - 1) / triangles_per_task);
    if (tasks <= 1)
        return search_range(0, tried);

    std::vector<std::optional<PlaneCandidate>> found(tasks);
    parallel_for(tasks, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t task = begin; task < end; ++task)
            found[task] = search_range(tried * task / tasks, tried * (task + 1) / tasks);
    });
    std::optional<PlaneCandidate> best;
    for (const auto &candidate : found)
        if (candidate && (!best || candidate->plane.cost < best->plane.cost))
            best = candidate;
    return best;
}

} // namespace bsp
