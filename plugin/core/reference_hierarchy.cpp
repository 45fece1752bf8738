#include "reference_hierarchy.h"

#include <cmath>
#include <numeric>

#include "sorting.h"

namespace bsp {
namespace {

Bounds bounds_of(const ReferenceList &references, std::size_t i) {
    Bounds box;
    for (std::uint32_t v = references.starts[i]; v < references.starts[i + 1]; ++v)
        box.extend(references.vertices[v]);
    return box;
}

/// Halves the range at the median of the widest axis, and the halves again.
void order_by_halves(std::uint32_t *first, std::uint32_t *last, const std::vector<Vec3d> &centres) {
    if (last - first <= Float8::width)
        return;
    Bounds box;
    for (const std::uint32_t *i = first; i != last; ++i)
        box.extend(centres[*i]);
    const Vec3d size = box.upper - box.lower;
    const std::size_t axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    std::uint32_t *const middle = first + (last - first) / 2;
    std::nth_element(first, middle, last, [&](std::uint32_t x, std::uint32_t y) {
        return centres[x][axis] != centres[y][axis] ? centres[x][axis] < centres[y][axis] : x < y;
    });
    order_by_halves(first, middle, centres);
    order_by_halves(middle, last, centres);
}

} // namespace

ReferenceList in_spatial_order(const ReferenceList &references) {
    std::vector<Vec3d> centres(references.size());
    for (std::size_t i = 0; i < references.size(); ++i) {
        const Bounds box = bounds_of(references, i);
        centres[i] = (box.lower + box.upper) * 0.5;
    }
    std::vector<std::uint32_t> order(references.size());
    std::iota(order.begin(), order.end(), 0u);
    order_by_halves(order.data(), order.data() + order.size(), centres);
    ReferenceList ordered;
    ordered.reserve(references.size(), references.vertices.size());
    for (const std::uint32_t i : order)
        ordered.add(references.ids[i], references.vertices.data() + references.starts[i],
                    references.starts[i + 1] - references.starts[i]);
    return ordered;
}

void ReferenceHierarchy::BoxGroup::set(unsigned lane, const Bounds &box) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const float middle = float((box.lower[axis] + box.upper[axis]) / 2);
        centre[axis][lane] = middle;
        half[axis][lane] = round_up(std::max(box.upper[axis] - middle, middle - box.lower[axis]));
    }
}

Bounds ReferenceHierarchy::BoxGroup::get(unsigned lane) const {
    Bounds box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        box.lower[axis] = double(centre[axis][lane]) - half[axis][lane];
        box.upper[axis] = double(centre[axis][lane]) + half[axis][lane];
    }
    return box;
}

ReferenceHierarchy::ReferenceHierarchy(const ReferenceList &references, double tolerance)
    : m_size(references.size()), m_tolerance(tolerance) {
    Level level;
    level.boxes = references.size();
    level.groups.resize((references.size() + Float8::width - 1) / Float8::width);
    Bounds all;
    for (std::size_t i = 0; i < references.size(); ++i) {
        const Bounds box = bounds_of(references, i);
        all.extend(box.lower);
        all.extend(box.upper);
        level.groups[i / Float8::width].set(i % Float8::width, box);
    }
    m_starts.reserve(level.groups.size() + 1);
    m_corners.reserve(3 * Float8::width * (references.vertices.size() / Float8::width + level.groups.size()));
    for (std::size_t group = 0; group < level.groups.size(); ++group)
        add_corners(references, group);
    // A box's extent along a normal takes seven roundings of at most u times the sum of the largest coordinates.
    double reach = 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
        reach += std::max(std::abs(all.lower[axis]), std::abs(all.upper[axis]));
    m_margin = tolerance + 8 * 0x1p-24 * reach;
    m_levels.push_back(std::move(level));
    while (m_levels.back().boxes > Float8::width)
        m_levels.push_back(coarser(m_levels.back()));
}

void ReferenceHierarchy::add_corners(const ReferenceList &references, std::size_t group) {
    const std::size_t first = group * Float8::width, last = std::min(first + Float8::width, references.size());
    std::uint32_t most = 0;
    for (std::size_t i = first; i < last; ++i)
        most = std::max(most, references.starts[i + 1] - references.starts[i]);
    const std::size_t start = m_corners.size();
    m_corners.resize(start + 3 * Float8::width * most);
    for (std::size_t i = first; i < last; ++i)
        for (std::uint32_t vertex = 0; vertex < most; ++vertex) {
            const bool has = vertex < references.starts[i + 1] - references.starts[i];
            const Vec3d &corner = references.vertices[references.starts[i] + (has ? vertex : 0)];
            for (std::size_t axis = 0; axis < 3; ++axis)
                m_corners[start + (3 * vertex + axis) * Float8::width + (i - first)] = corner[axis];
        }
    m_starts.push_back(std::uint32_t(m_corners.size()));
}

ReferenceHierarchy::Level ReferenceHierarchy::coarser(const Level &fine) const {
    Level level;
    level.boxes = fine.groups.size();
    level.span = fine.span * Float8::width;
    level.groups.resize((level.boxes + Float8::width - 1) / Float8::width);
    for (std::size_t i = 0; i < fine.boxes; i += Float8::width) {
        Bounds box;
        for (std::size_t j = i; j < std::min<std::size_t>(fine.boxes, i + Float8::width); ++j) {
            const Bounds part = fine.groups[i / Float8::width].get(unsigned(j - i));
            box.extend(part.lower);
            box.extend(part.upper);
        }
        const std::size_t at = i / Float8::width;
        level.groups[at / Float8::width].set(at % Float8::width, box);
    }
    return level;
}

/// A plane, spread over the lanes.
class ReferenceHierarchy::PlaneLanes {
public:
    PlaneLanes(const Direction &direction, float offset, double margin)
        : m_axes{direction.major, next_axis[direction.major], after_axis[direction.major]},
          m_a(Float8::all(direction.a)), m_b(Float8::all(direction.b)), m_size_a(Float8::all(std::abs(direction.a))),
          m_size_b(Float8::all(std::abs(direction.b))), m_low(Float8::all(float(offset - margin))),
          m_high(Float8::all(float(offset + margin))) {}

    Sides classify(const BoxGroup &group, unsigned lanes) const {
        const auto [k, i, j] = m_axes;
        const Float8 middle =
            fmadd(m_b, load(group.centre[j]), fmadd(m_a, load(group.centre[i]), load(group.centre[k])));
        const Float8 half =
            fmadd(m_size_b, load(group.half[j]), fmadd(m_size_a, load(group.half[i]), load(group.half[k])));
        const unsigned below = (middle + half < m_low).bits() & lanes, above = (middle - half > m_high).bits() & lanes;
        return {below, above, lanes & ~(below | above)};
    }

private:
    static Float8 load(const float *values) { return Float8::load(values); }

    struct {
        std::uint8_t k, i, j;
    } m_axes;
    Float8 m_a, m_b, m_size_a, m_size_b, m_low, m_high;
};

std::uint32_t ReferenceHierarchy::references_in(const Level &level, std::size_t group, unsigned lanes) const {
    std::uint32_t count = level.span * std::uint32_t(__builtin_popcount(lanes));
    const std::size_t last = level.boxes - 1; // the one box that may hold fewer
    if (group == last / Float8::width && (lanes >> last % Float8::width & 1u) != 0)
        count -= std::uint32_t(level.boxes * level.span - m_size);
    return count;
}

/// A plane in double precision, compared with the vertices of eight references at a time.
class ReferenceHierarchy::Corners {
public:
    Corners(const Direction &direction, double offset, double tolerance)
        : m_axes{direction.major, next_axis[direction.major], after_axis[direction.major]},
          m_a(_mm256_set1_pd(direction.a)), m_b(_mm256_set1_pd(direction.b)), m_low(_mm256_set1_pd(offset - tolerance)),
          m_high(_mm256_set1_pd(offset + tolerance)) {}

    /// Which references have vertices below the plane, and which above it.
    Sides classify(const double *corner, const double *end) const {
        Sides sides{0, 0, 0};
        for (; corner != end; corner += 3 * Float8::width)
            for (unsigned half : {0, 4}) {
                const __m256d position = position_of(corner + half);
                sides.below |= bits(_mm256_cmp_pd(position, m_low, _CMP_LT_OQ)) << half;
                sides.above |= bits(_mm256_cmp_pd(position, m_high, _CMP_GT_OQ)) << half;
            }
        return sides;
    }

private:
    /// As `position` in direction.h, bit for bit.
    __m256d position_of(const double *corner) const {
        const auto load = [&](std::uint8_t axis) { return _mm256_loadu_pd(corner + axis * Float8::width); };
        const auto [k, i, j] = m_axes;
        return _mm256_add_pd(_mm256_add_pd(load(k), _mm256_mul_pd(m_a, load(i))), _mm256_mul_pd(m_b, load(j)));
    }
    static unsigned bits(__m256d comparison) { return unsigned(_mm256_movemask_pd(comparison)); }

    struct {
        std::uint8_t k, i, j;
    } m_axes;
    __m256d m_a, m_b, m_low, m_high;
};

std::optional<SideCounts> ReferenceHierarchy::count(const Direction &direction, float offset, const SidePrices &prices,
                                                    Scratch &scratch) const {
    auto &[groups, finer, work] = scratch;
    const PlaneLanes plane(direction, offset, m_margin);
    const Corners exact(direction, offset, m_tolerance);
    SideCounts counts;
    std::uint32_t remaining = std::uint32_t(m_size);
    groups.assign(1, 0);
    for (auto level = m_levels.rbegin(); level != m_levels.rend(); ++level) {
        finer.clear();
        for (const std::uint32_t group : groups) {
            const std::size_t first = std::size_t(group) * Float8::width, boxes = level->boxes - first;
            const unsigned lanes = boxes >= Float8::width ? 0xffu : (1u << boxes) - 1;
            const Sides sides = plane.classify(level->groups[group], lanes);
            const std::uint32_t below = references_in(*level, group, sides.below);
            const std::uint32_t above = references_in(*level, group, sides.above);
            counts.below += below;
            counts.above += above;
            remaining -= below + above;
            if (level->span > 1) {
                for (unsigned rest = sides.unknown; rest != 0; rest &= rest - 1)
                    finer.push_back(std::uint32_t(first + unsigned(__builtin_ctz(rest))));
            } else if (sides.unknown != 0) {
                const Sides found =
                    exact.classify(m_corners.data() + m_starts[group], m_corners.data() + m_starts[group + 1]);
                const auto number = [&](unsigned set) { return unsigned(__builtin_popcount(set & sides.unknown)); };
                counts.below += number(found.below);
                counts.above += number(found.above);
                counts.on += number(~(found.below | found.above));
                remaining -= number(~0u);
                work += number(~0u);
            }
            if (prices.is_out(counts, remaining))
                return std::nullopt;
        }
        std::swap(groups, finer);
    }
    return counts;
}

} // namespace bsp
