/// The helper hierarchy of Ize, Wald, Parker (2008, section 4): counts the references of a node on either side of any
/// plane without looking at each of them.
#pragma once

#include <algorithm>
#include <optional>

#include "references.h"
#include "settings.h"
#include "simd.h"

namespace bsp {

/// The references in another order: neighbours in space are neighbours in the list, and stay so in every part of it.
ReferenceList in_spatial_order(const ReferenceList &references);

/// References that lie below, on and above a plane; one that crosses it counts below and above.
struct SideCounts {
    std::uint32_t below = 0, on = 0, above = 0;
};

/// What the references on both sides of a plane cost together.
struct SidePrices {
    double below = 0, above = 0; ///< shares of the cell's area
    CostModel cost;
    double limit = HUGE_VAL; ///< what costs this much or more is of no interest

    double price(std::uint32_t count_below, std::uint32_t count_above) const {
        return cost.split_price(below, count_below, above, count_above);
    }
    /// Whether it must reach the limit, wherever the `remaining` references lie.
    bool is_out(const SideCounts &counts, std::uint32_t remaining) const {
        const double more = cost.empty_bonus * std::min(below, above) * cost.intersection_cost * remaining;
        return price(counts.below, counts.above) + more >= limit;
    }
};

/// Boxes around the references in groups of eight, boxes around those eight times coarser, and so on. The references
/// are best in spatial order.
class ReferenceHierarchy {
public:
    /// References within `tolerance` of a plane, along its normal, lie on it; what reaches no further beyond the plane
    /// does not cross it. As `split_references` with the same tolerance.
    ReferenceHierarchy(const ReferenceList &references, double tolerance);

    std::uint32_t size() const { return std::uint32_t(m_size); }

    /// What `count` needs besides, one for each thread: memory, and the number of references whose vertices were looked
    /// at so far.
    struct Scratch {
        std::vector<std::uint32_t> groups, finer;
        std::size_t work = 0;
    };

    /// Nothing if the prices reach their limit. From many threads at once.
    std::optional<SideCounts> count(const Direction &direction, float offset, const SidePrices &prices,
                                    Scratch &scratch) const;

private:
    /// Centres and half sizes, [axis][lane], of eight boxes.
    struct alignas(32) BoxGroup {
        float centre[3][Float8::width], half[3][Float8::width];

        void set(unsigned lane, const Bounds &box);
        Bounds get(unsigned lane) const;
    };

    /// The boxes of `groups[0]` are the references'; those of the next level hold a group each.
    struct Level {
        std::vector<BoxGroup> groups;
        std::size_t boxes = 0;
        std::uint32_t span = 1; ///< references below one box, the last one's aside
    };

    struct Sides {
        unsigned below, above, unknown; ///< a bit per lane
    };
    class PlaneLanes;
    class Corners;

    Level coarser(const Level &fine) const;
    std::uint32_t references_in(const Level &level, std::size_t group, unsigned lanes) const;
    void add_corners(const ReferenceList &references, std::size_t group);

    std::size_t m_size; ///< number of references
    double m_tolerance;
    double m_margin; ///< tolerance and rounding errors of the float arithmetic on boxes
    std::vector<Level> m_levels;
    /// The vertices of the references, those of each group of eight together: [vertex][axis][lane], as many as its
    /// largest reference has, the others repeating their first. `m_starts` says where a group's are.
    std::vector<double> m_corners;
    std::vector<std::uint32_t> m_starts{0};
};

} // namespace bsp
